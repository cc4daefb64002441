"""Coding order of the times of the temporal basis.

Multiples of 4 precede the times half-way between known ones, and so on; the core predicts each from
the known times around it. Resting times are coded last, each predicted from the previous time.
Coefficients of cosines over time are coded by frequency instead.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel.basis import NO_REST, Rests
from meshreel.kernel.fields import CodingOrder, Pass, order_of

COARSEST = 4
"""Frames between the times coded first."""

COLUMNS_BEFORE = 2
"""Number of previous columns whose value at the same time is a context neighbor."""

FREQUENCIES_BEFORE = 4
"""Number of lower frequencies that are context neighbors."""


@lru_cache(maxsize=8)
def time_passes(n_columns: int, n_frames: int, rests: Rests = NO_REST) -> tuple[Pass, ...]:
    """Return the coding passes of the residuals of a mode, with their context neighbors.

    Columns of the track follow each other, each over time: x, y and z of positions. Each level of
    moving times is a pass, and all resting times are one. Context neighbors are the adjacent known
    times, the previous two of the level, and the same time in the previous two columns.
    """
    flags = rests.flags(n_frames)
    is_resting = np.zeros(n_frames, np.bool_) if flags is None else flags > 0
    moving = np.flatnonzero(~is_resting)
    half = COARSEST // 2
    offsets = [-2 * half, -4 * half]
    passes = [_pass(np.arange(0, len(moving), COARSEST), offsets, moving, n_columns, n_frames)]
    while half:
        places = np.arange(half, len(moving), 2 * half)
        offsets = [-half, half, -2 * half, -4 * half]
        passes.append(_pass(places, offsets, moving, n_columns, n_frames))
        half //= 2
    if rests.runs:
        passes.append(_resting_pass(is_resting, n_columns, n_frames))
    return tuple(passes)


def frequency_pass(n_columns: int, n_frames: int) -> Pass:
    """Return the coding pass of the coefficients of a mode, with their context neighbors.

    Columns of the track follow each other, each with its lowest frequency first.
    """
    frequencies = np.arange(n_frames)
    before = frequencies[:, None] - np.arange(1, FREQUENCIES_BEFORE + 1)
    return _pass_of_times(frequencies, np.maximum(before, -1), n_columns, n_frames)


@lru_cache(maxsize=8)
def time_order(
    n_columns: int, n_frames: int, rests: Rests = NO_REST, *, has_cosines: bool = False
) -> CodingOrder:
    """Return the passes of times, or of frequencies, as arrays of the core."""
    passes: tuple[Pass, ...] = time_passes(n_columns, n_frames, rests)
    if has_cosines:
        passes = (frequency_pass(n_columns, n_frames),)
    return order_of(passes, n_columns * n_frames)


def _pass(
    places: Integers, offsets: list[int], moving: Integers, n_columns: int, n_frames: int
) -> Pass:
    """Return the pass of moving times, given by their places among all moving times.

    Context neighbors lie at offsets in places, and in previous columns.
    """
    others = places[:, None] + offsets
    exists = (others >= 0) & (others < len(moving))
    neighbors = np.where(exists, moving[np.where(exists, others, 0)], -1)
    return _pass_of_times(moving[places], neighbors, n_columns, n_frames)


def _resting_pass(is_resting: npt.NDArray[np.bool_], n_columns: int, n_frames: int) -> Pass:
    """Return the pass of the resting times; the two previous times are contexts if they rest."""
    times = np.flatnonzero(is_resting)
    before = np.maximum(times[:, None] - [1, 2], 0)  # time 0 does not rest
    return _pass_of_times(times, np.where(is_resting[before], before, -1), n_columns, n_frames)


def _pass_of_times(times: Integers, neighbors: Integers, n_columns: int, n_frames: int) -> Pass:
    """Return the pass of times of all columns; `neighbors` are padded with -1.

    They are times of the same column; neighbors in previous columns are added.
    """
    exists = neighbors >= 0
    near = []
    for column in range(n_columns):
        in_column = np.where(exists, neighbors + n_frames * column, -1)
        before = column + np.arange(-COLUMNS_BEFORE, 0)
        same_time = np.where(before >= 0, times[:, None] + n_frames * before, -1)
        near.append(np.hstack([in_column, same_time]))
    listed = np.concatenate(near)
    starts = np.concatenate([[0], np.cumsum((listed >= 0).sum(axis=1))])
    columns = np.concatenate([times + n_frames * column for column in range(n_columns)])
    return Pass(columns, starts, listed[listed >= 0])
