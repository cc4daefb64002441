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
    lengths: Real = np.linalg.norm(residuals, axis=1, keepdims=True)
    moved: Real = pulls + residuals * np.clip(1 - bound / np.maximum(lengths, 1e-30), 0, 1)
    lengths = np.linalg.norm(moved, axis=1, keepdims=True)
    moved *= np.minimum(1, MAX_PULL * bound / np.maximum(lengths, 1e-30))
    return moved
