import numpy as np
import pytest

from meshreel.codec.reel.normative.timeline import frequency_pass, time_passes
from meshreel.kernel.basis import Rests

every_width = pytest.mark.parametrize("n_columns", [1, 2, 3, 6])
every_length = pytest.mark.parametrize("n_frames", [1, 2, 3, 7, 8, 9, 16, 17, 31, 100])


@every_width
@every_length
def test_passes_take_every_time_of_every_column_once_when_a_mode_is_coded(n_columns, n_frames):
    columns = np.concatenate([step.columns for step in time_passes(n_columns, n_frames)])
    assert sorted(columns) == list(range(n_columns * n_frames))


@every_width
@every_length
def test_a_time_is_told_of_by_times_around_and_before_and_other_columns(n_columns, n_frames):
    known = set()
    for level, step in enumerate(time_passes(n_columns, n_frames)):
        near = np.split(step.indices, step.indptr[1:-1]) if len(step.columns) else []
        distance = (2, 2, 1)[level]
        offsets = (-4, -2) if level == 0 else (-4, -2, -1, 1)
        assert len(step.indptr) == len(step.columns) + 1
        for column, told in zip(step.columns.tolist(), near, strict=True):
            own, time = divmod(column, n_frames)
            around = {time + distance * offset for offset in offsets} & set(range(n_frames))
            wanted = {own * n_frames + other for other in around}
            wanted |= {other * n_frames + time for other in range(max(0, own - 2), own)}
            assert len(told) == len(wanted)
            assert set(told.tolist()) == wanted <= known
            known.add(column)


RESTS = Rests(((1, 3), (6, 7), (9, 12)))


def test_moving_times_are_coded_as_if_there_were_no_others():
    moving = np.array([0, 3, 4, 5, 7, 8])
    of_all, of_moving = time_passes(2, 12, RESTS)[:3], time_passes(2, 6)
    for found, wanted in zip(of_all, of_moving, strict=True):
        for name in ("columns", "indices"):
            columns, times = np.divmod(getattr(wanted, name), 6)
            np.testing.assert_array_equal(getattr(found, name), 12 * columns + moving[times])
        np.testing.assert_array_equal(found.indptr, wanted.indptr)


def test_resting_times_come_last_and_know_those_before_that_rest():
    *_, last = time_passes(2, 12, RESTS)
    np.testing.assert_array_equal(last.columns, [1, 2, 6, 9, 10, 11, 13, 14, 18, 21, 22, 23])
    near = np.split(last.indices, last.indptr[1:-1])
    assert [one.tolist() for one in near[:6]] == [[], [1], [], [], [9], [10, 9]]
    assert [one.tolist() for one in near[6:]] == [[1], [13, 2], [6], [9], [21, 10], [22, 21, 11]]


@every_width
@every_length
def test_a_frequency_is_told_of_by_lower_ones_and_other_columns(n_columns, n_frames):
    found = frequency_pass(n_columns, n_frames)
    np.testing.assert_array_equal(found.columns, np.arange(n_columns * n_frames))
    near = np.split(found.indices, found.indptr[1:-1])
    for place, told in enumerate(near):
        column, k = divmod(place, n_frames)
        wanted = {column * n_frames + lower for lower in range(max(0, k - 4), k)}
        wanted |= {other * n_frames + k for other in range(max(0, column - 2), column)}
        assert len(told) == len(wanted)
        assert set(told.tolist()) == wanted
