import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.model.timing import Timing
from samples.meshes import waving_grid

RATES = [12.5, 23.976, 24, 25, 29.97, 30000 / 1001, 30, 48, 59.94, 60, 1000]


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("start_s", [0.0, 1.5, 1001 / 24, -2.0])
def test_float64_times_give_the_exact_frame_rate(fps, start_s):
    result = Timing.of_times(start_s + np.arange(40) / fps)
    assert result == Timing(fps, start_s)


@pytest.mark.parametrize("fps", RATES)
def test_float32_times_give_a_common_frame_rate(fps):
    result = Timing.of_times((1.5 + np.arange(40) / fps).astype(np.float32))
    # float32 cannot distinguish 29.97 from 30000/1001.
    assert result.fps == pytest.approx(fps, rel=2e-6)
    assert result.times is None


def test_single_frame_has_no_frame_rate():
    result = Timing.of_times(np.array([4.25]))
    assert result == Timing(0.0, 4.25)


def test_uneven_times_give_the_mean_frame_rate():
    result = Timing.of_times(np.array([0.0, 0.1, 0.5, 1.0]))
    assert (result.fps, result.start_s) == (3.0, 0.0)
    np.testing.assert_array_equal(result.times, [0.0, 0.1, 0.5, 1.0])


UNEVEN = [0, 0.005, 0.01, 0.015, 0.0175]


def sheet(n_frames=5, **options):
    return waving_grid(n_frames).replace(**options)


def test_uneven_times_are_kept_and_even_ones_become_a_rate():
    assert sheet(times=UNEVEN).times.tolist() == UNEVEN
    even = sheet(4, times=UNEVEN[:4])
    assert (even.timing, even.fps) == (Timing(200), 200)


@pytest.mark.parametrize(
    ("times", "fps"),
    [
        ([float(f"{i / 24:.6g}") for i in range(300)], 24),  # as VTK writes them
        ([float(f"{0.5 + i / 30:.5f}") for i in range(100)], 30),
        (np.cumsum(np.full(1000, 0.1)), 10),
        (10 + 0.1 * np.arange(200), 10),
        ([0, 1, 2.0009, 3], None),
        (0.04 * np.arange(500) + np.where(np.arange(500) == 77, 1e-9, 0), None),
        (1e-6 * np.cumsum(1 + 1e-4 * np.sin(np.arange(50))), None),
    ],
)
def test_times_are_even_only_if_their_digits_say_so(times, fps):
    timing = Timing.of_times(times)
    if fps is None:
        np.testing.assert_array_equal(timing.times, times)
    else:
        assert timing.times is None
        assert timing.fps == fps


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0, 1, 2], r"must have shape \(5,\); got \(3,\)"),
        ([0, 1, 1, 2, 3], "frame 1 is at time 1 and frame 2 at 1; times must ascend"),
        ([0, 1, np.nan, 2, 3], "time 2 is not finite"),
        ([0, 1, 2, 3, "x"], "times must be numbers"),
        ([-1e308, 0, 1, 2, 1.7e308], "the last time minus the first is not finite"),
    ],
)
def test_invalid_times_are_refused(times, message):
    with pytest.raises(InvalidInputError, match=message):
        sheet(times=times)


def test_times_and_a_rate_exclude_each_other():
    grid = waving_grid(5)
    with pytest.raises(InvalidInputError, match="either times, or fps and start_s"):
        MeshSequence(grid.vertices, grid.faces, fps=25, times=UNEVEN)
    with pytest.raises(InvalidInputError, match="either times, or fps and start_s"):
        sheet(times=UNEVEN, fps=25)
    timed = sheet(times=UNEVEN)
    assert timed.replace(fps=10).times.tolist() == [0, 0.1, 0.2, 0.3, 0.4]
    assert timed.replace(start_s=1).times.tolist() == [1 + time for time in UNEVEN]


def test_parts_and_concatenations_keep_times():
    timed = sheet(times=UNEVEN)
    assert timed[1:4].times.tolist() == UNEVEN[1:4]
    assert timed[4:].times.tolist() == UNEVEN[4:]
    assert (timed[:2] + timed[2:]).times.tolist() == UNEVEN
    with pytest.raises(InvalidInputError, match="must ascend"):
        timed + timed
    with pytest.raises(InvalidInputError, match="some frames have times and others no frame rate"):
        timed + sheet(fps=0)


def test_the_frame_at_a_time_is_the_last_one_due():
    timing = Timing.of_times(UNEVEN)
    times = [-1, 0, 0.0049, 0.005, 0.016, 0.0175, 9]
    assert [timing.frame_at(time, 5) for time in times] == [0, 0, 0, 1, 3, 4, 4]
    assert [Timing(10, 1.0).frame_at(time, 5) for time in (0, 1.0, 1.1, 1.39, 9)] == [0, 0, 1, 3, 4]


def test_segments_of_a_sequence_keep_its_times():
    times = [0, 0.3, 0.5, 0.6]
    several = MeshSequence.of_segments([waving_grid(2), waving_grid(2, 5, 5)]).replace(times=times)
    again = MeshSequence.of_segments([several])
    assert again.times.tolist() == times
    assert again.n_segments == 2
