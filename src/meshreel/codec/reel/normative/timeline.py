"""Coding order of the times of the temporal basis.

Multiples of 4 precede the times half-way between known ones, and so on; the core predicts each from
the known times around it. Resting times are coded last, each predicted from the previous time.
Coefficients of cosines over time are coded by frequency instead.
"""

from functools import lru_cache

import numpy as np

from meshreel.arrays import Integers
from meshreel.kernel.basis import NO_REST, Rests
from meshreel.kernel.fields import CodingOrder, coding_order

COARSEST = 4
"""Frames between the times coded first."""

COLUMNS_BEFORE = 2
"""Number of previous columns whose value at the same time is a context neighbor."""


N_NEAR = 4
"""Largest number of context neighbors in the same column."""

Pass = tuple[Integers, Integers]
"""Times, and their context neighbors, padded with -1, of shape (n, N_NEAR)."""


@lru_cache(maxsize=8)
def time_order(
    n_columns: int, n_frames: int, rests: Rests = NO_REST, *, has_cosines: bool = False
) -> CodingOrder:
    """Return the coding order of the residuals of a mode, or of its coefficients of cosines.

    Columns of the track follow each other, each over time: x, y and z of positions. Context
    neighbors in the same column are those of `_times` or `_frequencies`; others are the same time
    in the previous two columns.
    """
    passes = _frequencies(n_frames) if has_cosines else _times(n_frames, rests)
    columns, near = [], []
    for times, neighbors in passes:
        for column in range(n_columns):
            before = column + np.arange(-COLUMNS_BEFORE, 0)
            same_time = np.where(before >= 0, times[:, None] + n_frames * before, -1)
            in_column = np.where(neighbors >= 0, neighbors + n_frames * column, -1)
            columns.append(times + n_frames * column)
            near.append(np.hstack([in_column, same_time]))
    starts = np.cumsum([0, *(n_columns * len(times) for times, _ in passes)], dtype=np.int64)
    return coding_order(np.concatenate(near), starts, np.concatenate(columns))


def _times(n_frames: int, rests: Rests) -> list[Pass]:
    """Return the passes of times of a column: levels of moving times, then all resting times.

    Context neighbors of a moving time are the adjacent known ones and the previous two of its
    level; those of a resting time are the previous two times, if they rest.
    """
    flags = rests.flags(n_frames)
    is_resting = np.zeros(n_frames, np.bool_) if flags is None else flags > 0
    moving, half = np.flatnonzero(~is_resting), COARSEST // 2
    passes = [_level(moving, np.arange(0, len(moving), COARSEST), [-2 * half, -4 * half])]
    while half:
        places = np.arange(half, len(moving), 2 * half)
        passes.append(_level(moving, places, [-half, half, -2 * half, -4 * half]))
        half //= 2
    if rests.runs:
        times = np.flatnonzero(is_resting)
        before = np.maximum(times[:, None] - [1, 2], 0)  # time 0 does not rest
        passes.append((times, _padded(np.where(is_resting[before], before, -1))))
    return passes


def _level(moving: Integers, places: Integers, offsets: list[int]) -> Pass:
    """Return the pass of times at these places among moving ones, with neighbors at offsets."""
    others = places[:, None] + offsets
    exists = (others >= 0) & (others < len(moving))
    return moving[places], _padded(np.where(exists, moving[np.where(exists, others, 0)], -1))


def _frequencies(n_frames: int) -> list[Pass]:
    """Return the pass of all frequencies; context neighbors are the four below each."""
    frequencies = np.arange(n_frames)
    return [(frequencies, np.maximum(frequencies[:, None] - np.arange(1, N_NEAR + 1), -1))]


def _padded(near: Integers) -> Integers:
    return np.pad(near, ((0, 0), (0, N_NEAR - near.shape[1])), constant_values=-1)
