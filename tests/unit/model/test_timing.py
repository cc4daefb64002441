from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.frame_choice import chosen_frames, consecutive_runs
from meshreel.model.sequence import MeshSequence
from meshreel.model.timing import UNTIMED, Timing
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


def test_frames_of_a_rate_start_at_zero_unless_a_start_is_given():
    assert (UNTIMED, Timing.of_rate(25.0)) == (Timing(0.0, 0.0), Timing(25.0, 0.0))
    assert Timing.of_rate(25.0, -2.0) == Timing(25.0, -2.0)
    single = Timing.of_times(np.array([4.25]))
    assert (single, *single.seconds(1), single.seconds(2)) == (Timing(0.0, 4.25), 4.25, None)


UNEVEN = [0, 0.005, 0.01, 0.015, 0.0175]


def sheet(n_frames=5, **options):
    return waving_grid(n_frames).replace(**options)


@pytest.mark.parametrize(
    ("times", "fps"),
    [
        (10 + 0.1 * np.arange(200), 10),
        ([0, 1, 2, 2.99999999999998], None),
        ([0, 1, 1.99999999999998, 3], None),
        ([float(f"{i / 24:.6g}") for i in range(300)], None),  # as VTK writes them
        (np.cumsum(np.full(1000, 0.1)), None),
        ((np.arange(40) / 24).astype(np.float32).astype(np.float64), None),
    ],
)
def test_times_are_a_rate_only_within_an_ulp(times, fps):
    timing = Timing.of_times(times)
    assert timing.start_s == times[0]
    if fps is None:
        np.testing.assert_array_equal(timing.times, times)
        assert timing.fps == pytest.approx((len(times) - 1) / (times[-1] - times[0]))
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
    assert sheet(times=UNEVEN).replace(fps=10).times.tolist() == [0, 0.1, 0.2, 0.3, 0.4]


@pytest.mark.parametrize("seed", range(8))
def test_times_of_parts_shifts_and_concatenations_are_those_of_a_list(seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.random(7)) - 1
    timed = sheet(7, times=times)
    for _ in range(8):
        change, number = rng.integers(3), int(rng.integers(2))
        if change == 0 and len(times) > 4:
            times, timed = times[number : 4 + number], timed[number : 4 + number]
        elif change == 1:
            times, timed = times - times[0] + number, timed.replace(start_s=number)
        else:
            later = times[-1] + np.cumsum(rng.random(3))
            times, timed = np.append(times, later), timed + sheet(3, times=later)
        np.testing.assert_allclose(timed.times, times, rtol=0, atol=1e-12)
        for time in (*timed.times, *(times + 1e-9), times[0] - 1):
            assert timed.frame_at(time) == max(0, np.searchsorted(timed.times, time, "right") - 1)


def test_a_declared_rate_is_that_of_times_near_it():
    near, far = 1 + np.array([0, 1, 2 + 1e-7, 3]) / 25, 1 + np.array([0, 1, 2 + 1e-5, 3]) / 25
    assert Timing.of_times(near, declared_fps=25) == Timing(25, 1)
    assert Timing.of_times(far, declared_fps=25).times.tolist() == far.tolist()


@pytest.mark.parametrize(
    ("first", "second", "times"),
    [
        ((1, 0), (1, 5), [0, 1, 2, 5, 6, 7]),
        ((1, 0), (2, 3), [0, 1, 2, 3, 3.5, 4]),
        ((1, 0), (1, 0), [0, 1, 2, 3, 4, 5]),  # follow the first
        ((24, 0.1), (24, 0.1 + 3 / 24), 0.1 + np.arange(6) / 24),
    ],
)
def test_concatenated_frames_keep_their_times_if_these_continue(first, second, times):
    parts = [sheet(3, fps=fps, start_s=start) for fps, start in (first, second)]
    assert meshreel.concatenate(parts).timing == Timing.of_times(times)


def test_times_that_do_not_continue_are_refused():
    timed = sheet(times=UNEVEN)
    with pytest.raises(InvalidInputError, match="must ascend"):
        timed + timed
    with pytest.raises(InvalidInputError, match="some frames have times and others no frame rate"):
        timed + sheet(fps=0)


def test_the_frame_at_a_time_is_the_last_one_due_at_a_rate():
    times = (0, 1.0, 1.1, 1.2 - 1.1e-7, 1.2 - 0.9e-7, 1.39, 9)
    assert [Timing(10, 1.0).frame_at(time, 5) for time in times] == [0, 0, 1, 1, 2, 3, 4]


def test_segments_of_a_sequence_keep_its_times():
    times = [0, 0.3, 0.5, 0.6]
    several = MeshSequence.of_segments([waving_grid(2), waving_grid(2, 5, 5)]).replace(times=times)
    again = MeshSequence.of_segments([several])
    assert again.times.tolist() == times
    assert again.n_segments == 2


DATA = encode(waving_grid(9), block_frames=4)
WHOLE = meshreel.decode(DATA)
EVEN = np.arange(9) % 2 == 0


@pytest.fixture(params=["sequence", "file"])
def frames(request):
    """A sequence of nine frames, in memory and in a file."""
    if request.param == "sequence":
        yield WHOLE
        return
    with ReelFile(BytesIO(DATA)) as reel:
        yield reel


@pytest.mark.parametrize("number", [0, 3, -1, -9, np.int32(4), np.uint8(8), np.array(5)])
def test_integer_index_returns_one_frame(frames, number):
    vertices, faces = frames[number]
    np.testing.assert_allclose(vertices, WHOLE.vertices[number], atol=1e-6)
    np.testing.assert_array_equal(faces, WHOLE.faces)


def test_slice_returns_a_sequence_with_its_start(frames):
    part = frames[2:7]
    assert (len(part), part.start_s) == (5, WHOLE.start_s + 2 / WHOLE.fps)
    np.testing.assert_allclose(part.vertices, WHOLE.vertices[2:7], atol=1e-6)
    np.testing.assert_allclose(frames[-3:99].vertices, WHOLE.vertices[-3:], atol=1e-6)


@pytest.mark.parametrize(
    ("chosen", "start"), [(slice(1, 9, 3), 1), (slice(None, None, -1), 0), (slice(7, 1, -2), 3)]
)
def test_slice_with_a_step_has_its_frames_and_a_lower_rate(frames, chosen, start):
    for part in (frames[chosen], meshreel.decode(DATA, frames=chosen)):
        np.testing.assert_allclose(part.vertices, WHOLE.vertices[chosen], atol=1e-6)
        assert part.timing == Timing(WHOLE.fps / abs(chosen.step), WHOLE.timing.at(start))


@pytest.mark.parametrize("chosen", [slice(5, 5), slice(7, 2), slice(2, 7, -1)])
def test_slices_that_are_empty_are_rejected(frames, chosen):
    with pytest.raises(InvalidInputError, match="select no frame"):
        frames[chosen]


def test_uneven_times_of_a_slice_with_a_step_are_listed():
    timed = sheet(times=UNEVEN)
    assert timed[::2].times.tolist() == [0, 0.01, 0.0175]
    np.testing.assert_allclose(timed[:0:-1].times, [0.005, 0.0075, 0.0125, 0.0175], atol=1e-15)


@pytest.mark.parametrize(
    "chosen",
    [
        slice(2, 7),
        slice(None),
        slice(-3, None),
        slice(5, 5),
        slice(7, 2),
        slice(1, 9, 3),
        slice(None, None, -1),
        slice(2, 99),
        [0, 8, 4, 4],
        [-1, 0],
        [],
        range(2, 5),
        np.array([7, 1], np.uint16),
        np.array([], np.int64),
        EVEN,
        EVEN.tolist(),
    ],
    ids=repr,
)
def test_chosen_frames_equal_numpy_indexing(chosen):
    by_numpy = (
        chosen if isinstance(chosen, slice) else np.asarray(chosen, None if len(chosen) else int)
    )
    selected = WHOLE.vertices[np.asarray(chosen_frames(chosen, 9), int)]
    np.testing.assert_array_equal(selected, WHOLE.vertices[by_numpy])


@pytest.mark.parametrize(
    "number", [9, -10, np.int64(9), 10**30, [0, 9], [-10], np.array([3, 200], np.uint8)], ids=repr
)
def test_index_error_states_the_valid_frames(number):
    with pytest.raises(IndexError, match=r"no frame (9|-10|200|10+); there are 9, from 0 to 8"):
        chosen_frames(number, 9)


def test_missing_frames_are_an_index_error(frames):
    with pytest.raises(IndexError, match=r"no frame 9; there are 9, from 0 to 8"):
        frames[9]


@pytest.mark.parametrize("mask", [EVEN[:5], [True], np.ones(10, bool)], ids=len)
def test_mask_must_cover_all_frames(mask):
    with pytest.raises(IndexError, match=f"{len(mask)} Booleans for 9 frames"):
        chosen_frames(mask, 9)


@pytest.mark.parametrize(
    "chosen",
    ["3", b"3", 1.0, None, True, np.True_, (1, 2), [1.5], [[1]], [[1], [2, 3]], np.float32(1), {1}],
    ids=repr,
)
def test_type_error_states_the_valid_indices(chosen):
    with pytest.raises(TypeError, match="must be a number, a slice, or a list or array"):
        chosen_frames(chosen, 9)


@pytest.mark.parametrize("chosen", ["3", 1.0, None, True, (1, 2), [1, 2]], ids=repr)
def test_index_of_another_type_is_a_type_error(frames, chosen):
    with pytest.raises(TypeError, match="select a frame by its number, or several by a slice"):
        frames[chosen]


@pytest.mark.parametrize("chosen", [5, 0, (0, 5), [0, 5], range(5), "0:5", slice(0.5, 3), ()])
def test_decode_accepts_only_slices_of_frames(chosen):
    data = meshreel.encode(waving_grid(4))
    with pytest.raises(InvalidInputError, match=r"frames must be a slice such as slice\(0, 10\)"):
        meshreel.decode(data, frames=chosen)


def test_length_iteration_and_reversal_cover_the_frames(frames):
    assert len(frames) == 9
    forward, backward = ([frame.vertices for frame in each] for each in (frames, reversed(frames)))
    np.testing.assert_allclose(np.stack(forward), WHOLE.vertices, atol=1e-6)
    np.testing.assert_allclose(np.stack(backward), WHOLE.vertices[::-1], atol=1e-6)


def test_frames_of_a_sequence_are_read_only():
    for vertices in (WHOLE[0].vertices, WHOLE[1:3].vertices):
        with pytest.raises(ValueError, match="read-only"):
            vertices[...] = 0


def test_chosen_frames_of_a_slice_is_a_range():
    assert chosen_frames(slice(None, None, -2), 5) == range(4, -1, -2)


def test_consecutive_runs_are_sorted_by_their_first_number():
    numbers = np.array([7, 8, 9, 2, 3, 3, 0])
    runs = [(6, range(1)), (3, range(2, 4)), (5, range(3, 4)), (0, range(7, 10))]
    assert list(consecutive_runs(numbers)) == runs
    assert list(consecutive_runs(numbers[:0])) == []
