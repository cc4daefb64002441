import numpy as np
import pytest

from meshreel.formats.scenes.timing import frame_times, neighbours

RATES = [12.5, 23.976, 24, 25, 29.97, 30000 / 1001, 30, 48, 59.94, 60, 1000]


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("start_s", [0.0, 1.5, 1001 / 24, -2.0])
def test_float64_times_give_the_exact_frame_rate(fps, start_s):
    result = frame_times(start_s + np.arange(40) / fps)
    assert (result.fps, result.start_s, result.is_even) == (fps, start_s, True)


@pytest.mark.parametrize("fps", RATES)
def test_float32_times_give_a_common_frame_rate(fps):
    result = frame_times((1.5 + np.arange(40) / fps).astype(np.float32))
    # float32 cannot distinguish 29.97 from 30000/1001.
    assert result.fps == pytest.approx(fps, rel=2e-6)
    assert result.is_even


def test_single_frame_has_no_frame_rate():
    result = frame_times(np.array([4.25]))
    assert (result.fps, result.start_s, result.is_even) == (0.0, 4.25, True)


def test_uneven_times_give_the_mean_frame_rate():
    result = frame_times(np.array([0.0, 0.1, 0.5, 1.0]))
    assert (result.fps, result.is_even) == (3.0, False)


@pytest.mark.parametrize(
    ("time_s", "expected"),
    [
        (0.0, (0, 0, 0.0)),
        (1.0, (0, 0, 0.0)),
        (1.0005, (0, 0, 0.0)),
        (1.9995, (1, 1, 0.0)),
        (3.0, (1, 2, 0.5)),
        (9.0, (2, 2, 0.0)),
    ],
)
def test_neighbours_snaps_to_a_frame_when_the_time_is_close(time_s, expected):
    assert neighbours(np.array([1.0, 2.0, 4.0]), time_s) == expected
