import numpy as np
import pytest

from meshreel.codec.reel.normative.timeline import frequency_pass, time_passes
from meshreel.kernel.basis import Rests

every_width = pytest.mark.parametrize("n_columns", [1, 2, 3, 6])
every_length = pytest.mark.parametrize("n_frames", [1, 2, 3, 7, 8, 9, 16, 17, 31, 100])


@every_width
@every_length
def test_passes_contain_every_time_of_every_column_once(n_columns, n_frames):
    columns = np.concatenate([step.columns for step in time_passes(n_columns, n_frames)])
    assert sorted(columns) == list(range(n_columns * n_frames))


@every_width
@every_length
def test_contexts_of_a_time_are_adjacent_and_previous_times_and_other_columns(n_columns, n_frames):
    known = set()
    for level, step in enumerate(time_passes(n_columns, n_frames)):
        near = np.split(step.indices, step.indptr[1:-1]) if len(step.columns) else []
        distance = (2, 2, 1)[level]
        offsets = (-4, -2) if level == 0 else (-4, -2, -1, 1)
        assert len(step.indptr) == len(step.columns) + 1
        for column, contexts in zip(step.columns.tolist(), near, strict=True):
            own, time = divmod(column, n_frames)
            around = {time + distance * offset for offset in offsets} & set(range(n_frames))
            expected = {own * n_frames + other for other in around}
            expected |= {other * n_frames + time for other in range(max(0, own - 2), own)}
            assert len(contexts) == len(expected)
            assert set(contexts.tolist()) == expected <= known
            known.add(column)


RESTS = Rests(((1, 3), (6, 7), (9, 12)))


def test_moving_times_are_coded_independently_of_resting_ones():
    moving = np.array([0, 3, 4, 5, 7, 8])
    of_all, of_moving = time_passes(2, 12, RESTS)[:3], time_passes(2, 6)
    for found, expected in zip(of_all, of_moving, strict=True):
        for name in ("columns", "indices"):
            columns, times = np.divmod(getattr(expected, name), 6)
            np.testing.assert_array_equal(getattr(found, name), 12 * columns + moving[times])
        np.testing.assert_array_equal(found.indptr, expected.indptr)


def test_resting_times_come_last_with_previous_resting_times_as_contexts():
    *_, last = time_passes(2, 12, RESTS)
    np.testing.assert_array_equal(last.columns, [1, 2, 6, 9, 10, 11, 13, 14, 18, 21, 22, 23])
    near = np.split(last.indices, last.indptr[1:-1])
    assert [one.tolist() for one in near[:6]] == [[], [1], [], [], [9], [10, 9]]
    assert [one.tolist() for one in near[6:]] == [[1], [13, 2], [6], [9], [21, 10], [22, 21, 11]]


@every_width
@every_length
def test_contexts_of_a_frequency_are_lower_ones_and_other_columns(n_columns, n_frames):
    found = frequency_pass(n_columns, n_frames)
    np.testing.assert_array_equal(found.columns, np.arange(n_columns * n_frames))
    near = np.split(found.indices, found.indptr[1:-1])
    for place, contexts in enumerate(near):
        column, k = divmod(place, n_frames)
        expected = {column * n_frames + lower for lower in range(max(0, k - 4), k)}
        expected |= {other * n_frames + k for other in range(max(0, column - 2), column)}
        assert len(contexts) == len(expected)
        assert set(contexts.tolist()) == expected
