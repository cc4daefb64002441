"""In which order the times of the temporal basis are coded.

Times that are multiples of 4 come first; then the times half-way between those known, and so on.
The core predicts each from those known around it. Times that rest are left out of this order and
follow at the end: each is predicted from the time before. Coefficients of cosines over time are
coded by frequency instead.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel.basis import NO_REST, Rests
from meshreel.kernel.fields import CodingOrder, Pass, order_of

COARSEST = 4
"""Frames between the times that come first."""


COLUMNS_BEFORE = 2
"""Columns whose time is a context neighbour of the same time."""

FREQUENCIES_BEFORE = 4
"""Lower frequencies that are context neighbours of one."""


@lru_cache(maxsize=8)
def time_passes(n_columns: int, n_frames: int, rests: Rests = NO_REST) -> tuple[Pass, ...]:
    """The order in which residuals of a mode are coded, with the context neighbours of each.

    A column of the track comes after another, each over time: of positions x, y and z. A level of
    moving times is a pass, and so are all resting ones. Context neighbours are the times around, if
    they are known, the two before of the level, and the time itself in the two columns before.
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
    """The order in which coefficients of a mode are coded, with the context neighbours of each.

    A column of the track comes after another, each from the lowest frequency on.
    """
    frequencies = np.arange(n_frames)
    before = frequencies[:, None] - np.arange(1, FREQUENCIES_BEFORE + 1)
    return _pass_of_times(frequencies, np.maximum(before, -1), n_columns, n_frames)


@lru_cache(maxsize=8)
def time_order(
    n_columns: int, n_frames: int, rests: Rests = NO_REST, *, has_cosines: bool = False
) -> CodingOrder:
    """The passes of `time_passes`, or that of frequencies, as the core takes them."""
    passes: tuple[Pass, ...] = time_passes(n_columns, n_frames, rests)
    if has_cosines:
        passes = (frequency_pass(n_columns, n_frames),)
    return order_of(passes, n_columns * n_frames)


def _pass(
    places: Integers, offsets: list[int], moving: Integers, n_columns: int, n_frames: int
) -> Pass:
    """A pass of some of the moving times, by their places among them, of all columns.

    Context neighbours lie at offsets in places, and in columns before.
    """
    others = places[:, None] + offsets
    exists = (others >= 0) & (others < len(moving))
    neighbours = np.where(exists, moving[np.where(exists, others, 0)], -1)
    return _pass_of_times(moving[places], neighbours, n_columns, n_frames)


def _resting_pass(is_resting: npt.NDArray[np.bool_], n_columns: int, n_frames: int) -> Pass:
    """The pass of the resting times; the two times before are context neighbours if they rest."""
    times = np.flatnonzero(is_resting)
    before = np.maximum(times[:, None] - [1, 2], 0)  # time 0 does not rest
    return _pass_of_times(times, np.where(is_resting[before], before, -1), n_columns, n_frames)


def _pass_of_times(times: Integers, neighbours: Integers, n_columns: int, n_frames: int) -> Pass:
    """A pass of times of all columns.

    Neighbours are times of the same column, -1 for none; those in the columns before are added.
    """
    exists = neighbours >= 0
    near = []
    for column in range(n_columns):
        in_column = np.where(exists, neighbours + n_frames * column, -1)
        before = column + np.arange(-COLUMNS_BEFORE, 0)
        same_time = np.where(before >= 0, times[:, None] + n_frames * before, -1)
        near.append(np.hstack([in_column, same_time]))
    listed = np.concatenate(near)
    starts = np.concatenate([[0], np.cumsum((listed >= 0).sum(axis=1))])
    columns = np.concatenate([times + n_frames * column for column in range(n_columns)])
    return Pass(columns, starts, listed[listed >= 0])
