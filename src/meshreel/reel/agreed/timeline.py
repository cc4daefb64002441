"""In which order the times of the temporal basis are coded.

Times that are multiples of 4 come first; then the times half-way between those known, and so on.
The core predicts each from those known around it.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.kernel.fields import CodingOrder, Pass, order_of

Integers = npt.NDArray[np.int64]

COARSEST = 4
"""Frames between the times that come first."""


COLUMNS_BEFORE = 2
"""Columns whose time is a context neighbour of the same time."""


@lru_cache(maxsize=8)
def time_passes(n_columns: int, n_frames: int) -> tuple[Pass, ...]:
    """The order in which residuals of a mode are coded, with the context neighbours of each.

    A column of the track comes after another, each over time: of positions x, y and z. A level of
    times is a pass. Context neighbours are the times around, if they are known, the two before of
    the level, and the time itself in the two columns before.
    """
    half = COARSEST // 2
    offsets = [-2 * half, -4 * half]
    passes = [_pass(np.arange(0, n_frames, COARSEST), offsets, n_columns, n_frames)]
    while half:
        times = np.arange(half, n_frames, 2 * half)
        offsets = [-half, half, -2 * half, -4 * half]
        passes.append(_pass(times, offsets, n_columns, n_frames))
        half //= 2
    return tuple(passes)


@lru_cache(maxsize=8)
def time_order(n_columns: int, n_frames: int) -> CodingOrder:
    """The passes of `time_passes`, as the core takes them."""
    return order_of(time_passes(n_columns, n_frames), n_columns * n_frames)


def _pass(times: Integers, offsets: list[int], n_columns: int, n_frames: int) -> Pass:
    """A pass of times of all columns; context neighbours lie at offsets, and in columns before."""
    others = times[:, None] + offsets
    exists = (others >= 0) & (others < n_frames)
    near = []
    for column in range(n_columns):
        in_column = np.where(exists, others + n_frames * column, -1)
        before = column + np.arange(-COLUMNS_BEFORE, 0)
        same_time = np.where(before >= 0, times[:, None] + n_frames * before, -1)
        near.append(np.hstack([in_column, same_time]))
    listed = np.concatenate(near)
    starts = np.concatenate([[0], np.cumsum((listed >= 0).sum(axis=1))])
    columns = np.concatenate([times + n_frames * column for column in range(n_columns)])
    return Pass(columns, starts, listed[listed >= 0])
