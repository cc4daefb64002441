import numpy as np
import pytest

from meshreel.reel.agreed.timeline import time_passes

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
