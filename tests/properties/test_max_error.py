"""Error bounds near the rounding of positions hold, or are refused; `law` tests larger ones."""

import numpy as np
from hypothesis import HealthCheck, assume, event, given, settings
from hypothesis import strategies as st

from meshreel import InvalidInputError, compare, decode, encode
from meshreel.codec.reel.encoding.corrections import FLOOR
from samples.costs import draws
from samples.strategies import odd_sequences

MAX_ROUNDING = 4.0
"""Bounds below this many spacings of the number type, plus the floor, may be refused."""

FEW_MODES = st.sampled_from([None, None, 1, 3])


def spacing_percent(sequence):
    """Return the spacing of the coordinates' number type in percent of the diagonal."""
    vertices = sequence.vertices
    diagonal = np.linalg.norm(np.ptp(vertices.astype(np.float64), axis=(0, 1))) or 1.0
    return 100 * float(np.spacing(np.abs(vertices).max())) / diagonal


@settings(max_examples=draws(60), suppress_health_check=[HealthCheck.too_slow])
@given(odd_sequences(np.float32), st.floats(0.1, 20.0), FEW_MODES)
def test_bounds_near_the_spacing_of_the_number_type_hold(sequence, spacings, n_modes):
    percent = spacings * spacing_percent(sequence)
    assume(percent < 1e4)  # a point far away
    try:
        data = encode(sequence, max_error=percent, n_modes=n_modes, effort=1)
    except InvalidInputError as error:
        event("refused")
        message = str(error)
        assert "cannot be guaranteed" in message
        assert percent < MAX_ROUNDING * spacing_percent(sequence) + 101 * FLOOR
        return
    assert compare(sequence, decode(data)).max_error_percent <= percent
