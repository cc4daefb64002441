"""Aims: positions beyond the given ones that pull a fit towards the worst vertices."""

import numpy as np

from meshreel.arrays import Real

MAX_PULL = 2.0
"""Largest distance between an aim and the given position, in error bounds."""


def farther(pulls: Real, residuals: Real, bound: float) -> Real:
    """Return vectors from given positions to aims, moved on where residuals exceed a bound.

    Parameters
    ----------
    pulls, residuals : float arrays
        Their second axis is x, y, z.
    """
    moved: Real = pulls + residuals * np.clip(1 - bound / _lengths(residuals), 0, 1)
    moved *= np.minimum(1, MAX_PULL * bound / _lengths(moved))
    return moved


def _lengths(vectors: Real) -> Real:
    squares: Real = np.einsum("iv...,iv...->i...", vectors, vectors)[:, np.newaxis]
    return np.asarray(np.maximum(np.sqrt(squares), 1e-30))
