import numpy as np
import pytest

from meshreel.entropy.contexts import (
    LOG_PARTS,
    MAX_MEAN_CLASS,
    N_EXPECTED,
    UNIT,
    Past,
    expected_classes,
    mean_class,
    mean_of_class,
    near_classes,
    past_classes,
)


@pytest.mark.parametrize("mean", [1, 2, 3, 100, 30_000])
def test_class_is_near_the_mean_when_a_pass_is_not_empty(mean):
    found = mean_class(np.full(10, mean))
    assert 0.7 * mean < mean_of_class(np.array(found)) / UNIT < 1.3 * mean


def test_class_is_zero_only_when_a_pass_is_empty():
    assert mean_class(np.zeros(5, np.int64)) == 0
    assert mean_class(np.eye(1, 3_000_000, dtype=np.int64)[0]) == 1


def test_class_is_limited_when_magnitudes_are_huge():
    assert mean_class(np.full(1000, 2**31 - 1)) == MAX_MEAN_CLASS


def test_classes_come_back_when_their_own_means_are_classed():
    for found in range(42, MAX_MEAN_CLASS + 1):  # below, means are no whole magnitudes
        mean = int(mean_of_class(np.array(found)))
        assert mean_class(np.array([mean // UNIT, -(-mean // UNIT)])) == found


def test_past_forgets_when_rows_go_by():
    past = Past(2)
    past.add(np.array([8, 0]), np.array([8 * UNIT, 0]))
    past.add(np.array([0, 1]), np.array([0, 3 * UNIT]))
    assert past.magnitudes.tolist() == [7 * UNIT, UNIT]
    assert past.means.tolist() == [7 * UNIT, 3 * UNIT]


def test_past_forgets_too_when_a_row_is_empty():
    past = Past(1)
    past.add(np.array([8]), np.array([16 * UNIT]))
    past.add(np.array([0]), np.array([0]))
    assert (past.magnitudes[0], past.means[0]) == (7 * UNIT, 14 * UNIT)


def expected(past=UNIT, past_mean=UNIT, near=0, near_mean=0, mean=UNIT):
    columns = [np.array([[one]]) for one in (past, past_mean, near, near_mean, mean)]
    return int(expected_classes(*columns)[0, 0])


def test_expected_class_follows_the_mean_when_nothing_stands_out():
    assert expected(mean=2 * UNIT) - expected(mean=UNIT) == 2
    assert expected(near=3, near_mean=3 * UNIT) == expected()
    assert expected(past=9 * UNIT, past_mean=9 * UNIT) == expected()


def test_expected_class_grows_when_past_or_neighbours_are_larger_than_usual():
    usual = expected(near=2, near_mean=2 * UNIT)
    assert expected(past=8 * UNIT, near=2, near_mean=2 * UNIT) > usual
    assert expected(near=9, near_mean=2 * UNIT) > usual
    assert expected(past=0, near=0, near_mean=2 * UNIT) < usual


def test_expected_class_falls_when_the_same_evidence_was_to_be_expected():
    assert expected(past=8 * UNIT, past_mean=64 * UNIT) < expected(past=8 * UNIT)
    assert expected(near=4, near_mean=64 * UNIT) < expected(near=4, near_mean=4 * UNIT)


def test_expected_classes_are_those_of_each_integer_when_there_are_many():
    past, usual = np.array([[0], [UNIT], [30 * UNIT]]), np.array([[UNIT], [5 * UNIT], [0]])
    near, near_mean = np.array([[3, 0], [0, 1], [1, 7]]), UNIT * np.array([[0, 2], [2, 0], [1, 1]])
    mean = np.array([UNIT // 2, UNIT // 8])
    together = expected_classes(past, usual, near, near_mean, mean)
    alone = [
        [
            expected(past[i, 0], usual[i, 0], near[i, row], near_mean[i, row], mean[row])
            for row in (0, 1)
        ]
        for i in range(3)
    ]
    assert together.tolist() == alone
    assert len(np.unique(together)) > 3


def test_expected_class_stays_in_its_range_when_evidence_is_extreme():
    largest = int(mean_of_class(np.array(MAX_MEAN_CLASS)))
    assert expected(past=2**40, near=2**18, near_mean=0, mean=largest) == N_EXPECTED - 1
    assert expected(past=0, near=0, near_mean=100 * largest, mean=1) == 0


def test_past_classes_change_at_their_bounds_when_magnitudes_grow():
    fifth = UNIT // 5
    past = np.array([0, 2 * fifth - 1, 2 * fifth, 5 * fifth, 9 * fifth, 15 * fifth, 24 * fifth])
    assert past_classes(past).tolist() == [0, 0, 1, 2, 3, 4, 5]


def test_near_classes_have_an_end_when_neighbours_are_large():
    assert near_classes(np.array([0, 1, 2, 3, 2**30])).tolist() == [0, 1, 2, 2, 2]


def test_logarithm_parts_divide_into_half_octaves():
    assert LOG_PARTS % 2 == 0
