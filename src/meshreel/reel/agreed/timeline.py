"""The temporal basis of modes, predicted along time from coarse to fine.

Times that are multiples of 4 come first; then the times half-way between those known, and so on.
A time between is predicted by the cubic polynomial through its two known neighbours on either
side, or by a lower one where the sequence ends.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.kernel.fields import CodingOrder, Pass, order_of
from meshreel.reel.agreed.closed_loop import Predictor

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

COARSEST = 4
"""Frames between the times that come first."""


@lru_cache(maxsize=8)
def time_predictors(n_frames: int) -> tuple[Predictor, ...]:
    """Predictors of the levels of a time line of T frames; the first predicts nothing."""
    first = np.arange(0, n_frames, COARSEST)
    predictors = [Predictor(first, csr_array((len(first), n_frames)))]
    spacing = COARSEST
    while spacing > 1:
        half = spacing // 2
        rows = np.arange(half, n_frames, spacing)
        predictors.append(Predictor(rows, _interpolation(rows, half, n_frames)))
        spacing = half
    return tuple(predictors)


@lru_cache(maxsize=8)
def time_passes(n_frames: int) -> tuple[Pass, ...]:
    """The order in which residuals of a mode are coded, with the context neighbours of each.

    Columns are x over time, then y and z. A level of times is a pass. Context neighbours are the
    times around, if they are known, the two before of the level, and the time itself on the axes
    before.
    """
    passes, half = [], COARSEST // 2
    for level, predictor in enumerate(time_predictors(n_frames)):
        around = [-half, half] if level else []
        passes.append(_pass(predictor.rows, [*around, -2 * half, -4 * half], n_frames))
        half = half // 2 if level else half
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


def _interpolation(rows: Integers, half: int, n_frames: int) -> csr_array:
    """Weights of shape (n, T) of the known times around each."""
    around = rows[:, None] + half * np.array([-3, -1, 1, 3])
    is_known = (around >= 0) & (around < n_frames)
    is_known[:, 0] &= is_known[:, 2]  # behind the last known time, only the nearest ones
    weights = np.zeros(around.shape)
    for pattern in np.unique(is_known, axis=0):
        weights[(is_known == pattern).all(axis=1)] = _lagrange(pattern)
    places = np.repeat(np.arange(len(rows)), 4).reshape(-1, 4)
    used = weights != 0
    return csr_array((weights[used], (places[used], around[used])), shape=(len(rows), n_frames))


def _lagrange(is_known: npt.NDArray[np.bool_]) -> Floats:
    """Weights at 0 of values at -3, -1, 1 and 3, of which some are known."""
    points = np.array([-3.0, -1.0, 1.0, 3.0])
    weights = np.zeros(4)
    known = np.flatnonzero(is_known)
    for one in known:
        others = points[known[known != one]]
        weights[one] = np.prod(others / (others - points[one]))
    return weights
