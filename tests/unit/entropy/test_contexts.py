import numpy as np
import pytest

from meshreel.entropy.contexts import (
    LOG_STEPS,
    MAX_SCALE,
    N_EXPECTED,
    UNIT,
    Past,
    expected_classes,
    mean_of_scale,
    past_classes,
    scale_of_row,
)


@pytest.mark.parametrize("mean", [1, 2, 3, 100, 30_000])
def test_scale_stands_for_the_mean_when_a_row_is_not_empty(mean):
    scale = scale_of_row(np.full(10, mean))
    assert 0.7 * mean < mean_of_scale(np.array(scale)) / UNIT < 1.3 * mean


def test_scale_is_zero_only_when_a_row_is_empty():
    assert scale_of_row(np.zeros(5, np.int64)) == 0
    assert scale_of_row(np.eye(1, 3_000_000, dtype=np.int64)[0]) == 1


def test_scale_has_an_end_when_magnitudes_are_huge():
    assert scale_of_row(np.full(1000, 2**31 - 1)) == MAX_SCALE


def test_past_forgets_when_rows_go_by():
    past = Past(1)
    past.add(np.array([8]), 8 * UNIT)
    past.add(np.array([0]), 0)
    assert past.columns.tolist() == [7 * UNIT]
    assert past.mean == 7 * UNIT


def expected(past, near, n_near, mean=UNIT):
    return int(
        expected_classes(np.array([past]), UNIT, np.array([near]), np.array([n_near]), mean)[0]
    )


def test_expected_class_follows_the_mean_when_nothing_stands_out():
    octave = expected(UNIT, 0, 0, 2 * UNIT) - expected(UNIT, 0, 0, UNIT)
    assert octave == 2
    assert expected(UNIT, 3, 3) == expected(UNIT, 0, 0)


def test_expected_class_grows_when_past_or_neighbours_are_larger():
    usual = expected(UNIT, 2, 2)
    assert expected(8 * UNIT, 2, 2) > usual
    assert expected(UNIT, 9, 2) > usual
    assert expected(0, 0, 2) < usual


def test_expected_class_stays_in_its_range_when_evidence_is_extreme():
    assert expected(2**40, 2**18, 4, int(mean_of_scale(np.array(MAX_SCALE)))) == N_EXPECTED - 1
    assert expected(0, 0, 100, 1) == 0


def test_past_classes_change_at_their_bounds_when_magnitudes_grow():
    fifth = UNIT // 5
    past = np.array([0, 2 * fifth - 1, 2 * fifth, 5 * fifth, 9 * fifth, 15 * fifth, 24 * fifth])
    assert past_classes(past).tolist() == [0, 0, 1, 2, 3, 4, 5]


def test_logarithm_steps_divide_into_half_octaves():
    assert LOG_STEPS % 2 == 0
