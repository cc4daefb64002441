import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import TimeSampling

TIMES = np.array([1.0, 2.0, 4.0])


def test_uniform_times_are_evenly_spaced():
    result = TimeSampling(np.array([0.5]), 0.25).times(4)
    np.testing.assert_array_equal(result, [0.5, 0.75, 1.0, 1.25])


def test_cyclic_times_repeat():
    result = TimeSampling(np.array([0.0, 0.1]), 1.0).times(5)
    np.testing.assert_array_equal(result, [0.0, 0.1, 1.0, 1.1, 2.0])


def test_acyclic_times_are_the_first_stored():
    np.testing.assert_array_equal(TimeSampling(TIMES, None).times(2), [1.0, 2.0])


@pytest.mark.parametrize(
    ("sampling", "n_samples", "message"),
    [
        (TimeSampling(TIMES, None), 4, "it lists 3 times for 4 samples"),
        (TimeSampling(TIMES[::-1], None), 3, "do not ascend"),
        (TimeSampling(np.array([0.0]), -1.0), 2, "do not ascend"),
        (TimeSampling(np.array([np.nan]), 1.0), 1, "do not ascend"),
        (TimeSampling(np.array([0.0]), 1e308), 1000, "do not ascend"),
        (TimeSampling(np.array([0.0]), 1e-300), 10, "10 samples span only 9e-300 s"),
    ],
)
def test_implausible_times_are_rejected(sampling, n_samples, message):
    with pytest.raises(FormatError, match=message):
        sampling.times(n_samples)
