import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.gltf.animation import CUBICSPLINE, INTERPOLATIONS, LINEAR, STEP, Curve, slerp
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


KEYS = np.array([1.0, 1.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, 1.0], [-1.0, 4.0]])
TIMES = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.999, 3.0, 9.0])


def rotation(degrees, axis=(0, 0, 1)):
    half = np.radians(degrees) / 2
    return np.append(np.sin(half) * np.array(axis, float), np.cos(half))


def test_linear_curve_is_piecewise_linear():
    result = Curve(KEYS, VALUES, LINEAR).at(TIMES)
    expected = [np.interp(TIMES, KEYS, column) for column in VALUES.T]
    np.testing.assert_allclose(result, np.transpose(expected), rtol=0, atol=1e-15)


def test_curve_has_the_exact_values_at_keys():
    values = np.array([[0.1, 1 / 3], [1e9, 2e-9], [np.pi, -np.e]])
    for interpolation in (LINEAR, STEP):
        np.testing.assert_array_equal(Curve(KEYS, values, interpolation).at(KEYS), values)


def test_step_curve_is_constant_until_the_next_key():
    result = Curve(KEYS, VALUES, STEP).at(TIMES)
    np.testing.assert_array_equal(result, VALUES[[0, 0, 0, 1, 1, 1, 2, 2]])


def test_spline_curve_reproduces_a_cubic():
    def cubic(t):
        return np.stack([t**3 - 2 * t, 0.5 * t**2 + t], axis=1)

    slopes = np.stack([3 * KEYS**2 - 2, KEYS + 1], axis=1)
    curve = Curve(KEYS, cubic(KEYS), CUBICSPLINE, (slopes, slopes))
    times = np.linspace(1, 3, 41)
    np.testing.assert_allclose(curve.at(times), cubic(times), rtol=0, atol=1e-13)


def test_spline_curve_uses_out_and_in_tangents_of_the_interval():
    in_tangents, out_tangents = np.full((3, 1), 100.0), np.zeros((3, 1))
    in_tangents[1], out_tangents[0] = 4, 2
    curve = Curve(KEYS, np.zeros((3, 1)), CUBICSPLINE, (in_tangents, out_tangents))
    # Hermite at one half: an eighth of the interval times the difference of slopes.
    np.testing.assert_allclose(curve.at(np.array([1.25])), [[0.5 * (2 - 4) / 8]], atol=1e-15)


def test_curve_with_one_key_is_constant():
    curve = Curve(KEYS[:1], VALUES[:1], LINEAR)
    np.testing.assert_array_equal(curve.at(TIMES), np.repeat(VALUES[:1], len(TIMES), axis=0))


def test_curve_has_the_later_value_of_two_keys_at_one_time():
    curve = Curve(np.array([0.0, 1, 1, 2]), np.array([[0.0], [1], [5], [6]]), LINEAR)
    np.testing.assert_array_equal(curve.at(np.array([0.5, 1, 1.5])), [[0.5], [5], [5.5]])


@pytest.mark.parametrize("degrees", [1e-9, 1e-4, 1, 90, 179, 179.9999])
def test_slerp_rotates_at_constant_speed(degrees):
    weights = np.linspace(0, 1, 11)[:, np.newaxis]
    ends = np.tile(rotation(0), (11, 1)), np.tile(rotation(degrees), (11, 1))
    expected = np.array([rotation(degrees * one) for one in weights[:, 0]])
    np.testing.assert_allclose(slerp(*ends, weights), expected, rtol=0, atol=2e-12)


def test_slerp_takes_the_shorter_arc():
    result = slerp(rotation(0)[np.newaxis], -rotation(60)[np.newaxis], np.array([[0.5]]))
    np.testing.assert_allclose(result, [rotation(30)], rtol=0, atol=1e-15)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_rotation_curve_has_unit_quaternions(interpolation):
    values = np.array([rotation(0), rotation(80), -rotation(200)])
    tangents = (values, values) if interpolation == CUBICSPLINE else None
    result = Curve(KEYS, values, interpolation, tangents, is_rotation=True).at(TIMES)
    np.testing.assert_allclose(np.linalg.norm(result, axis=1), 1, rtol=0, atol=1e-15)
