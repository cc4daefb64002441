"""Floats that are integer multiples of a common factor."""

import numpy as np
import pytest

from meshreel.codec.entropy.tables import (
    GRID,
    MAX_INTEGER,
    UNORM8,
    UNORM16,
    as_multiples,
    values_of,
)


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize(
    ("values", "code", "integers"),
    [
        ([0.0, 3.0], 0, [0, 3]),
        ([0.1, 25.3], 1, [1, 253]),
        ([1e-9], 9, [1]),
        ([1 / 255, 1.0], UNORM8, [1, 255]),
        ([1 / 65535, 1.0], UNORM16, [1, 65535]),
        ([0.5, 0.75], GRID + 2, [2, 3]),
        ([2.0**-24], GRID + 24, [1]),
        ([float(MAX_INTEGER)], 0, [MAX_INTEGER]),
    ],
)
def test_values_are_integers_by_the_coarsest_number(values, code, integers, dtype):
    given = np.array(values, dtype)
    multiples = list(as_multiples(given))
    assert dict(multiples)[code].tolist() == integers
    assert len(dict(multiples)) == len(multiples)
    for form, whole in multiples:
        assert values_of(whole, form, given.dtype).tobytes() == given.tobytes()


@pytest.mark.parametrize("values", [[2.0**-25], [2.0 * MAX_INTEGER], [np.pi], [np.nan], [-0.0]])
def test_values_without_a_coded_factor_are_unchanged(values):
    assert list(as_multiples(np.array(values))) == []
