"""The temporal basis of modes, predicted along time from coarse to fine.

Times that are multiples of 4 come first; then the times half-way between those known, and so on.
A time between is predicted by the cubic polynomial through its two known neighbours on either
side, or by a lower one where the sequence ends.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.entropy.passes import Pass
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

    Columns are x over time, then y and z. A level of times is a pass; the times that predict one
    are its context neighbours.
    """
    passes = []
    for predictor in time_predictors(n_frames):
        weights = predictor.weights
        starts, near = weights.indptr.astype(np.int64), weights.indices.astype(np.int64)
        passes.append(
            Pass(
                _for_each_axis(predictor.rows, n_frames),
                np.concatenate([starts, starts[1:] + starts[-1], starts[1:] + 2 * starts[-1]]),
                _for_each_axis(near, n_frames),
            )
        )
    return tuple(passes)


def _for_each_axis(times: Integers, n_frames: int) -> Integers:
    return np.concatenate([times, times + n_frames, times + 2 * n_frames])


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
