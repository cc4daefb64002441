"""The guaranteed error bound holds for any mesh."""

import numpy as np
from hypothesis import HealthCheck, assume, event, example, given, settings
from hypothesis import strategies as st

from meshreel import InvalidInputError, MeshSequence, compare, decode, encode
from meshreel.codec.reel.encoding.corrections import FLOOR
from samples.costs import draws
from samples.strategies import bodies, moving, odd_sequences

MAX_ROUNDING = 4.0
"""Bounds below this many spacings of the number type, plus the floor, may be refused."""

PERCENTS = (1e-4, 0.01, 0.3, 5.0, 80.0)
CUTS = st.sampled_from([None, None, 1, 5])
FEW_MODES = st.sampled_from([None, None, 1, 3])


def many_components():
    rng = np.random.default_rng(3)
    n_verts, faces = bodies(400, 5)
    return MeshSequence(moving(rng, "rigid", 4, rng.normal(size=(n_verts, 3))), faces)


def spacing_percent(sequence):
    """Return the spacing of the coordinates' number type in percent of the diagonal."""
    vertices = sequence.vertices
    diagonal = np.linalg.norm(np.ptp(vertices.astype(np.float64), axis=(0, 1))) or 1.0
    return 100 * float(np.spacing(np.abs(vertices).max())) / diagonal


def assert_bound_holds(sequence, percent, **options):
    try:
        data = encode(sequence, max_error=percent, **options)
    except InvalidInputError as error:
        event("refused")
        message = str(error)
        assert "cannot be guaranteed" in message
        assert percent < MAX_ROUNDING * spacing_percent(sequence) + 101 * FLOOR
        return
    decoded = decode(data)
    np.testing.assert_array_equal(decoded.faces, sequence.faces)
    assert decoded.vertices.dtype == sequence.vertices.dtype
    assert compare(sequence, decoded).max_error_percent <= percent


@settings(max_examples=draws(80), suppress_health_check=[HealthCheck.too_slow])
@given(odd_sequences(), st.sampled_from(PERCENTS), st.integers(1, 9), CUTS, FEW_MODES)
@example(many_components(), 0.05, 5, None, None)
@example(many_components(), 0.5, 1, 3, 1)
def test_the_error_bound_holds_for_any_mesh(sequence, percent, effort, block_frames, n_modes):
    """Few modes require many corrections."""
    options = {"effort": effort, "block_frames": block_frames, "n_modes": n_modes}
    assert_bound_holds(sequence, percent, **options)


@settings(max_examples=draws(60), suppress_health_check=[HealthCheck.too_slow])
@given(odd_sequences(np.float32), st.floats(0.1, 20.0), FEW_MODES)
def test_bounds_near_the_spacing_of_the_number_type_hold(sequence, spacings, n_modes):
    percent = spacings * spacing_percent(sequence)
    assume(percent < 1e4)  # a point far away
    assert_bound_holds(sequence, percent, n_modes=n_modes, effort=1)


@settings(max_examples=draws(60), suppress_health_check=[HealthCheck.too_slow])
@given(odd_sequences(), st.sampled_from(PERCENTS), CUTS, FEW_MODES, st.data())
def test_the_error_bound_holds_for_ranges_of_frames(sequence, percent, block_frames, n_modes, data):
    """Corrections are applied to the right frames."""
    start = data.draw(st.integers(0, sequence.n_frames - 1))
    frames = slice(start, data.draw(st.integers(start + 1, sequence.n_frames)))
    try:
        stream = encode(
            sequence, max_error=percent, block_frames=block_frames, n_modes=n_modes, effort=1
        )
    except InvalidInputError:
        return
    decoded = decode(stream, frames=frames).vertices.astype(np.float64)
    error = np.linalg.norm(decoded - sequence.vertices[frames], axis=2).max()
    diagonal = np.linalg.norm(np.ptp(sequence.vertices.astype(np.float64), axis=(0, 1)))
    assert 100 * error <= percent * diagonal
