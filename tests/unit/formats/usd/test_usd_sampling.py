"""Selection of the time codes of frames."""

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.usd.sampling import (
    Samples,
    distinct_codes,
    even_codes,
    even_interval,
    frame_grid,
    sampled_codes,
)


def frames(stored, keys, frame_interval=1.0, origin=None):
    """Return the frames of a mesh with these samples; the default origin is the first sample."""
    result = Samples(np.array(stored, np.float64), np.array(keys, np.float64))
    return result.frames(frame_interval, result.all[0] if origin is None else origin)


def test_distinct_codes_are_sorted_without_duplicates():
    result = distinct_codes([3.0, 1.0, 2.0, 2.0 + 1e-9, 1.0])
    np.testing.assert_array_equal(result, [1, 2, 3])


@pytest.mark.parametrize("code", [np.inf, np.nan, -1e10])
def test_distinct_codes_reject_huge_and_invalid_codes(code):
    with pytest.raises(FormatError, match="expected -"):
        distinct_codes([1.0, code, 2.0])


def test_even_interval_tolerates_rounding_errors():
    assert even_interval(np.arange(100.0) * (1 / 3)) == pytest.approx(1 / 3, abs=1e-12)
    assert even_interval(1001 + np.arange(100.0) * 1.0000000001) == 1
    assert even_interval(np.array([1.0, 2, 4])) == 0
    assert even_interval(np.array([5.0])) == 0


@pytest.mark.parametrize("samples", [[], [4], [1, 2, 3], [0, 2.5, 5], [10.25, 10.5, 10.75]])
def test_even_codes_return_even_samples_unchanged(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(even_codes(samples, 0.0), samples)


def test_even_codes_drop_samples_for_motion_blur():
    samples = (np.arange(1, 5)[:, None] + [-0.25, 0, 0.25]).ravel()
    np.testing.assert_array_equal(even_codes(samples, 0.0), [1, 2, 3, 4])


def test_even_codes_keep_a_final_sample_between_integer_codes():
    np.testing.assert_array_equal(even_codes(np.array([0.0, 1, 2, 2.5]), 0.0), np.arange(6) / 2)
    samples = np.array([0.0, 1, 2, 3.3])
    np.testing.assert_array_equal(even_codes(samples, 0.0), samples)


def test_even_codes_fill_gaps_that_are_multiples_of_the_smallest():
    np.testing.assert_array_equal(even_codes(np.array([2.0, 4, 6, 12]), 1.0), [2, 4, 6, 8, 10, 12])


@pytest.mark.parametrize("samples", [[0, 33, 67, 100], [0, 1, 1000], [0.1, 0.4, 1.1]])
def test_even_codes_return_irregular_samples_unchanged(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(even_codes(samples, 0.0), samples)


def test_sampled_codes_are_all_frames_between_sparse_keys():
    result = sampled_codes(np.array([1.0, 5]), 1.0, 1.0)
    np.testing.assert_array_equal(result, [1, 2, 3, 4, 5])
    result = sampled_codes(np.array([0.0, 7, 10]), 2.5, 0.0)
    np.testing.assert_array_equal(result, [0, 2.5, 5, 7.5, 10])


def test_sampled_codes_are_aligned_to_the_origin():
    result = sampled_codes(np.array([6.0, 12]), 2.5, 0.0)
    np.testing.assert_array_equal(result, [5, 7.5, 10, 12.5])


@pytest.mark.parametrize("samples", [[3], [1, 2, 3], [0, 0.5, 1]])
def test_sampled_codes_are_the_samples_if_dense(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(sampled_codes(samples, 1.0, samples[0]), samples)


@pytest.mark.parametrize(
    ("stored", "keys"), [([], [0, 30, 60]), ([5], [0, 60]), ([0, 60], [0, 60]), ([0, 40], [20, 60])]
)
def test_frames_are_those_of_the_stage_for_sparse_keys(stored, keys):
    np.testing.assert_array_equal(frames(stored, keys), np.arange(61))


@pytest.mark.parametrize("stored", [[0, 60], [0, 10, 20], [3, 33, 66], [0, 2, 4]])
def test_frames_are_the_samples_of_points_without_keys(stored):
    np.testing.assert_array_equal(frames(stored, []), stored)


@pytest.mark.parametrize("keys", [[0, 40], [10, 30], [0, 1, 2], [1, 39], [8, 12.5, 40]])
def test_frames_of_a_cache_ignore_keys_between_them(keys):
    np.testing.assert_array_equal(frames(np.arange(0, 41, 2), keys), np.arange(0, 41, 2))


def test_frames_of_a_cache_extend_to_the_range_of_keys():
    np.testing.assert_array_equal(frames(np.arange(10, 21, 2), [5, 27]), np.arange(4, 29, 2))


@pytest.mark.parametrize("last", [3.3, 3 + 1e-5, 4 - 1e-9, 4.0])
def test_frame_grid_has_one_frame_after_a_last_sample_between_frames(last):
    np.testing.assert_array_equal(frame_grid(1.0, last, 1.0), [1, 2, 3, 4])


def test_frame_grid_is_exact_for_fractional_intervals():
    result = frame_grid(1001.0, 1101.0, 24 / 30)
    assert len(result) == 126
    np.testing.assert_array_equal(result[::5], np.arange(1001, 1102, 4))


@pytest.mark.parametrize("last", [1e18, 1e308])
def test_frame_grid_rejects_too_many_frames(last):
    with pytest.raises(FormatError, match="the limit is 1000000"):
        frame_grid(-1e308 if last > 1e300 else 0.0, last, 1.0)
