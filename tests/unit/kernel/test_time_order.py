import numpy as np
import pytest

from meshreel.kernel.basis import BasisCoding, Rests, time_order
from samples.passes import passes_of

every_width = pytest.mark.parametrize("n_columns", [1, 2, 3, 6])
every_length = pytest.mark.parametrize("n_frames", [1, 2, 3, 7, 8, 9, 16, 17, 31, 100])


@every_width
@every_length
def test_contexts_of_a_time_are_adjacent_and_previous_times_and_other_columns(n_columns, n_frames):
    known = set()
    for level, (columns, near) in enumerate(passes_of(time_order(n_columns, n_frames))):
        distance = (2, 2, 1)[level]
        offsets = (-4, -2) if level == 0 else (-4, -2, -1, 1)
        for column, contexts in zip(columns.tolist(), near, strict=True):
            own, time = divmod(column, n_frames)
            around = {time + distance * offset for offset in offsets} & set(range(n_frames))
            expected = {own * n_frames + other for other in around}
            expected |= {other * n_frames + time for other in range(max(0, own - 2), own)}
            assert len(contexts) == len(expected)
            assert set(contexts) == expected <= known
            assert column not in known
            known.add(column)
    assert known == set(range(n_columns * n_frames))


RESTS = BasisCoding(Rests(((1, 3), (6, 7), (9, 12))))


def test_moving_times_are_coded_independently_of_resting_ones():
    moving = np.array([0, 3, 4, 5, 7, 8])

    def renumbered(numbers):
        columns, times = np.divmod(np.array(numbers, int), 6)
        return (12 * columns + moving[times]).tolist()

    of_all, of_moving = passes_of(time_order(2, 12, RESTS))[:3], passes_of(time_order(2, 6))
    for (columns, near), (own_columns, own_near) in zip(of_all, of_moving, strict=True):
        assert columns.tolist() == renumbered(own_columns)
        assert near == list(map(renumbered, own_near))


def test_resting_times_come_last_with_previous_resting_times_as_contexts():
    *_, (columns, near) = passes_of(time_order(2, 12, RESTS))
    assert columns.tolist() == [1, 2, 6, 9, 10, 11, 13, 14, 18, 21, 22, 23]
    assert near[:6] == [[], [1], [], [], [9], [10, 9]]
    assert near[6:] == [[1], [13, 2], [6], [9], [21, 10], [22, 21, 11]]


@every_width
@every_length
def test_contexts_of_a_frequency_are_lower_ones_and_other_columns(n_columns, n_frames):
    ((columns, near),) = passes_of(time_order(n_columns, n_frames, BasisCoding(has_cosines=True)))
    np.testing.assert_array_equal(columns, np.arange(n_columns * n_frames))
    for place, contexts in enumerate(near):
        column, k = divmod(place, n_frames)
        expected = {column * n_frames + lower for lower in range(max(0, k - 4), k)}
        expected |= {other * n_frames + k for other in range(max(0, column - 2), column)}
        assert len(contexts) == len(expected)
        assert set(contexts) == expected
