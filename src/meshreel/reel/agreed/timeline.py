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


@lru_cache(maxsize=8)
def time_passes(n_frames: int) -> tuple[Pass, ...]:
    """The order in which residuals of a mode are coded, with the context neighbours of each.

    Columns are x over time, then y and z. A level of times is a pass. Context neighbours are the
    times around, if they are known, the two before of the level, and the time itself on the axes
    before.
    """
    half = COARSEST // 2
    passes = [_pass(np.arange(0, n_frames, COARSEST), [-2 * half, -4 * half], n_frames)]
    while half:
        times = np.arange(half, n_frames, 2 * half)
        passes.append(_pass(times, [-half, half, -2 * half, -4 * half], n_frames))
        half //= 2
    return tuple(passes)


@lru_cache(maxsize=8)
def time_order(n_frames: int) -> CodingOrder:
    """The passes of `time_passes`, as the core takes them."""
    return order_of(time_passes(n_frames), 3 * n_frames)


def _pass(times: Integers, offsets: list[int], n_frames: int) -> Pass:
    """A pass of times on all axes; context neighbours lie at offsets, and on axes before."""
    others = times[:, None] + offsets
    exists = (others >= 0) & (others < n_frames)
    near = []
    for axis in range(3):
        on_axis = np.where(exists, others + n_frames * axis, -1)
        same_time = np.where(np.arange(2) < axis, times[:, None] + n_frames * np.arange(2), -1)
        near.append(np.hstack([on_axis, same_time]))
    listed = np.concatenate(near)
    starts = np.concatenate([[0], np.cumsum((listed >= 0).sum(axis=1))])
    columns = np.concatenate([times + n_frames * axis for axis in range(3)])
    return Pass(columns, starts, listed[listed >= 0])
