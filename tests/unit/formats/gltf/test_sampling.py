import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf.read import common_rate, sample_times


def float32(times):
    return np.unique(np.asarray(times, np.float32)).astype(np.float64)


def sampled(keys, fps=0.0, *, is_curved=True):
    notes = []
    return sample_times(float32(keys), fps, is_curved=is_curved, notes=notes), notes


@pytest.mark.parametrize("fps", [12, 24, 25, 30000 / 1001, 60, 240])
@pytest.mark.parametrize("start", [0, 1, 100, 86_400])
def test_rate_of_even_keys_is_exact(fps, start):
    result, notes = sampled((start + np.arange(50)) / fps)
    assert (result.fps, notes) == (pytest.approx(fps, rel=1e-12), [])
    np.testing.assert_array_equal(result.times_s, (start + np.arange(50)) / result.fps)


@pytest.mark.parametrize(
    ("frames", "fps"),
    [([0, 5, 7, 30], 24), ([0, 2, 3, 4, 6], 24), ([0, 2, 5, 20], 24), ([10, 13, 17], 60)],
)
def test_rate_of_keys_with_gaps_is_the_common_one(frames, fps):
    result, notes = sampled(np.array(frames) / fps)
    assert (result.fps, notes) == (fps, [])
    assert len(result.times_s) == frames[-1] - frames[0] + 1


@pytest.mark.parametrize("keys", [[0, 0.1, 0.31, 0.97], [0, 0.999, 1, 2], [0, 1e-4, 5]])
def test_rate_of_irregular_keys_is_thirty_and_noted(keys):
    result, [note, *_] = sampled(keys)
    assert result.fps == 30
    assert "not evenly spaced; sampled at 30 frames per second" in note


def test_rate_of_sparse_keys_on_a_curve_is_thirty_and_noted():
    result, [note] = sampled([0, 0.25, 0.5])
    assert (result.fps, len(result.times_s)) == (30, 16)
    assert "at 4 per second with curved motion between them" in note


def test_rate_of_sparse_keys_on_a_line_is_that_of_the_keys():
    result, notes = sampled([0, 0.25, 0.5], is_curved=False)
    assert (result.fps, len(result.times_s), notes) == (4, 3, [])


@pytest.mark.parametrize(("fps", "n_frames"), [(24, 25), (10, 11), (7, 8)])
def test_times_span_the_keys_at_a_requested_rate(fps, n_frames):
    result, notes = sampled([2, 2.3, 3], fps)
    assert (result.fps, notes) == (fps, [])
    np.testing.assert_allclose(result.times_s, 2 + np.arange(n_frames) / fps, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("end", "fps", "n_frames", "last"),
    [
        (0.25, 30, 9, "0.266667"),
        (1, 0.5, 2, "2"),
        (1, 24.5, 26, "1.02041"),
        (0.01, 30, 2, "0.0333"),
    ],
)
def test_last_frame_shows_the_last_key_between_two_frames(end, fps, n_frames, last):
    result, [note] = sampled([2, 2 + end / 3, 2 + end], fps)
    np.testing.assert_allclose(result.times_s, 2 + np.arange(n_frames) / fps, rtol=0, atol=1e-15)
    assert result.curve_times_s[-1] == float32([2 + end])[0]
    assert f"the last frame, {last}" in note
    assert note.endswith("s after the first, shows its final pose")


@pytest.mark.parametrize("end", [0.25, 2_000.0003])
def test_last_frame_snaps_to_the_last_key(end):
    result, _ = sampled([0, 0.1, end], 40)
    assert result.curve_times_s[-1] == float32([end])[0]
    assert abs(result.times_s[-1] - end) <= 0.05 / 40


def test_curve_times_snap_to_rounded_keys():
    keys = float32(np.arange(1, 49) / 24)
    result, _ = sampled(keys)
    np.testing.assert_array_equal(result.curve_times_s, keys)
    np.testing.assert_array_equal(result.times_s, np.arange(1, 49) / 24)


def test_single_key_gives_one_frame():
    result, notes = sampled([1.5])
    assert (result.times_s.tolist(), result.fps, notes) == ([1.5], 0, [])


@pytest.mark.parametrize(("end", "fps"), [(1e30, 0), (1e5, 0), (10, 1e9), (3.4e38, 24)])
def test_sampling_rejects_too_many_frames(end, fps):
    with pytest.raises(FormatError, match=r"the limit is 100000; choose a lower rate"):
        sampled([0, 0.1, end], fps)


@pytest.mark.parametrize("keys", [[1.0], [1.0, 1.0 + 1e-7]])
def test_keys_at_one_time_have_no_rate(keys):
    assert common_rate(np.array(keys)) == 0
