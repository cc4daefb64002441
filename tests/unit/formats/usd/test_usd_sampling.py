"""At which time codes a mesh has its frames."""

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
    """Where a mesh has its frames that has these samples; the origin is its first."""
    found = Samples(np.array(stored, np.float64), np.array(keys, np.float64))
    return found.frames(frame_interval, found.all[0] if origin is None else origin)


def test_distinct_codes_are_ascending_when_given_in_any_order_with_rounding():
    found = distinct_codes([3.0, 1.0, 2.0, 2.0 + 1e-9, 1.0])
    np.testing.assert_array_equal(found, [1, 2, 3])


@pytest.mark.parametrize("code", [np.inf, np.nan, -1e10])
def test_distinct_codes_refuse_when_codes_cannot_be_told_apart(code):
    with pytest.raises(FormatError, match="allowed are"):
        distinct_codes([1.0, code, 2.0])


def test_even_interval_is_exact_when_intervals_are_rounded():
    assert even_interval(np.arange(100.0) * (1 / 3)) == pytest.approx(1 / 3, abs=1e-12)
    assert even_interval(1001 + np.arange(100.0) * 1.0000000001) == 1
    assert even_interval(np.array([1.0, 2, 4])) == 0
    assert even_interval(np.array([5.0])) == 0


@pytest.mark.parametrize("samples", [[], [4], [1, 2, 3], [0, 2.5, 5], [10.25, 10.5, 10.75]])
def test_even_codes_are_the_samples_when_these_are_even(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(even_codes(samples), samples)


def test_even_codes_are_whole_when_samples_beside_them_are_for_motion_blur():
    samples = (np.arange(1, 5)[:, None] + [-0.25, 0, 0.25]).ravel()
    np.testing.assert_array_equal(even_codes(samples), [1, 2, 3, 4])


def test_even_codes_keep_the_final_sample_when_it_alone_is_beside_a_whole_code():
    np.testing.assert_array_equal(even_codes(np.array([0.0, 1, 2, 2.5])), np.arange(6) / 2)
    samples = np.array([0.0, 1, 2, 3.3])
    np.testing.assert_array_equal(even_codes(samples), samples)


def test_even_codes_fill_gaps_when_the_smallest_gap_divides_all():
    np.testing.assert_array_equal(even_codes(np.array([2.0, 4, 6, 12])), [2, 4, 6, 8, 10, 12])


@pytest.mark.parametrize("samples", [[0, 33, 67, 100], [0, 1, 1000], [0.1, 0.4, 1.1]])
def test_even_codes_stay_uneven_when_nothing_plain_divides_them(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(even_codes(samples), samples)


def test_sampled_codes_are_every_frame_when_keys_are_further_apart():
    found = sampled_codes(np.array([1.0, 5]), 1.0, 1.0)
    np.testing.assert_array_equal(found, [1, 2, 3, 4, 5])
    found = sampled_codes(np.array([0.0, 7, 10]), 2.5, 0.0)
    np.testing.assert_array_equal(found, [0, 2.5, 5, 7.5, 10])


def test_sampled_codes_are_on_frames_of_the_others_when_they_begin_later():
    found = sampled_codes(np.array([6.0, 12]), 2.5, 0.0)
    np.testing.assert_array_equal(found, [5, 7.5, 10, 12.5])


@pytest.mark.parametrize("samples", [[3], [1, 2, 3], [0, 0.5, 1]])
def test_sampled_codes_are_the_samples_when_there_is_one_to_a_frame_or_more(samples):
    samples = np.array(samples, np.float64)
    np.testing.assert_array_equal(sampled_codes(samples, 1.0, samples[0]), samples)


@pytest.mark.parametrize(
    ("stored", "keys"), [([], [0, 30, 60]), ([5], [0, 60]), ([0, 60], [0, 60]), ([0, 40], [20, 60])]
)
def test_frames_are_those_of_the_stage_when_transforms_have_keys_far_apart(stored, keys):
    np.testing.assert_array_equal(frames(stored, keys), np.arange(61))


@pytest.mark.parametrize("stored", [[0, 60], [0, 10, 20], [3, 33, 66], [0, 2, 4]])
def test_frames_are_the_samples_of_points_when_nothing_else_moves(stored):
    np.testing.assert_array_equal(frames(stored, []), stored)


@pytest.mark.parametrize("keys", [[0, 40], [10, 30], [0, 1, 2], [1, 39], [8, 12.5, 40]])
def test_frames_are_those_of_the_cache_when_transforms_move_it_between(keys):
    np.testing.assert_array_equal(frames(np.arange(0, 41, 2), keys), np.arange(0, 41, 2))


def test_frames_go_on_as_those_of_the_cache_when_transforms_do():
    np.testing.assert_array_equal(frames(np.arange(10, 21, 2), [5, 27]), np.arange(4, 29, 2))


@pytest.mark.parametrize("last", [3.3, 3 + 1e-5, 4 - 1e-9, 4.0])
def test_frame_grid_has_one_frame_behind_the_last_sample_when_that_is_between_frames(last):
    np.testing.assert_array_equal(frame_grid(1.0, last, 1.0), [1, 2, 3, 4])


def test_frame_grid_is_exact_when_the_step_is_not():
    found = frame_grid(1001.0, 1101.0, 24 / 30)
    assert len(found) == 126
    np.testing.assert_array_equal(found[::5], np.arange(1001, 1102, 4))


@pytest.mark.parametrize("last", [1e18, 1e308])
def test_frame_grid_refuses_when_there_would_be_too_many_frames(last):
    with pytest.raises(FormatError, match="at most 1000000 are read"):
        frame_grid(-1e308 if last > 1e300 else 0.0, last, 1.0)
