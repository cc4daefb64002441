import numpy as np
import pytest

from meshreel.reel.agreed.timeline import COARSEST, time_passes, time_predictors

every_length = pytest.mark.parametrize("n_frames", [1, 2, 3, 7, 8, 9, 16, 17, 31, 100])


@every_length
def test_every_time_is_in_one_level_when_all_are_taken_together(n_frames):
    rows = np.concatenate([predictor.rows for predictor in time_predictors(n_frames)])
    assert sorted(rows) == list(range(n_frames))


@every_length
def test_weights_sum_to_one_when_a_time_is_predicted(n_frames):
    first, *later = time_predictors(n_frames)
    assert first.weights.nnz == 0
    assert first.rows.tolist() == list(range(0, n_frames, COARSEST))
    for predictor in later:
        np.testing.assert_allclose(predictor.weights.sum(axis=1), 1.0, atol=1e-12)


@every_length
def test_only_times_of_earlier_levels_have_weights_when_a_time_is_predicted(n_frames):
    known = np.zeros(n_frames, bool)
    for predictor in time_predictors(n_frames):
        assert predictor.weights.shape == (len(predictor.rows), n_frames)
        assert known[predictor.weights.indices].all()
        known[predictor.rows] = True


def degree_predicted(predictor, place, n_frames):
    """Highest degree up to which all powers of time are predicted at a place of a level."""
    time = np.arange(n_frames) - float(predictor.rows[place])
    for degree in range(5):
        wanted = float(degree == 0)
        if abs(predictor.weights[[place]] @ time**degree - wanted)[0] > 1e-9 * n_frames**degree:
            return degree - 1
    return 5


def known_around(time, half, n_frames):
    return [0 <= time + far * half < n_frames for far in (-3, -1, 1, 3)]


@every_length
def test_polynomials_are_predicted_as_far_as_known_times_allow(n_frames):
    """Cubic ones inside; where the line ends, what lies ahead is what the last known time had."""
    half = COARSEST // 2
    for predictor in time_predictors(n_frames)[1:]:
        for place, time in enumerate(predictor.rows):
            known = known_around(time, half, n_frames)
            wanted = sum(known) - 1 if known[2] else 0
            assert degree_predicted(predictor, place, n_frames) == wanted
        half //= 2


def test_cubic_curves_are_predicted_exactly_when_all_four_neighbours_are_known():
    time = np.arange(100) / 10
    curve = time**3 - 20 * time**2 + 3 * time - 4
    n_inside, half = 0, COARSEST // 2
    for predictor in time_predictors(100)[1:]:
        inside = [all(known_around(row, half, 100)) for row in predictor.rows]
        error = np.abs(predictor.weights @ curve - curve[predictor.rows])
        assert error[inside].max() < 1e-10
        n_inside, half = n_inside + sum(inside), half // 2
    assert n_inside > 50


def test_weights_are_those_of_the_nearest_when_a_time_lies_behind_all_known():
    """Two frames: the second is predicted by the first alone."""
    *_, last = time_predictors(2)
    assert last.rows.tolist() == [1]
    assert last.weights.toarray().tolist() == [[1.0, 0.0]]


@every_length
def test_passes_take_every_time_of_every_axis_once_when_a_mode_is_coded(n_frames):
    columns = np.concatenate([step.columns for step in time_passes(n_frames)])
    assert sorted(columns) == list(range(3 * n_frames))


@every_length
def test_a_time_is_told_of_by_times_around_and_before_and_other_axes_when_coded(n_frames):
    known = set()
    for level, step in enumerate(time_passes(n_frames)):
        near = np.split(step.indices, step.indptr[1:-1]) if len(step.columns) else []
        distance = (2, 2, 1)[level]
        offsets = (-4, -2) if level == 0 else (-4, -2, -1, 1)
        assert len(step.indptr) == len(step.columns) + 1
        for column, told in zip(step.columns.tolist(), near, strict=True):
            axis, time = divmod(column, n_frames)
            around = {time + distance * offset for offset in offsets} & set(range(n_frames))
            wanted = {axis * n_frames + other for other in around}
            wanted |= {other * n_frames + time for other in range(axis)}
            assert len(told) == len(wanted)
            assert set(told.tolist()) == wanted <= known
            known.add(column)
