"""Corrections of single positions, so that a largest error can be promised.

After a block is decoded, the positions that lie beyond the bound are moved by whole steps. They
stand together in vertices and runs of frames, and are coded so.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STEP_OF_BOUND = 1.1
"""Step of corrections by the bound: half of it along each axis is 0.95 of the bound away."""

MARGIN = 1e-3
"""Share of the bound that is kept free, for what another machine computes in its last bits."""


@dataclass(frozen=True)
class Corrections:
    """Whole steps by which positions of a block are moved.

    Attributes
    ----------
    step : float32
        In diagonals.
    vertices, frames : int64 arrays of shape (N,)
        Internal vertex numbers and frames of the block, ordered by vertex, then frame.
    offsets : int64 array of shape (N, 3)
    """

    step: np.float32
    vertices: Integers
    frames: Integers
    offsets: Integers

    @property
    def moves(self) -> Floats:
        """Of shape (N, 3), in diagonals."""
        return np.asarray(self.offsets * float(self.step))


def find_corrections(errors: Floats, bound: float) -> Corrections:
    """What brings all positions of a block within a bound.

    Parameters
    ----------
    errors : float64 array of shape (T, V, 3)
        True positions less decoded ones, in diagonals; vertices in internal order.
    bound : float
        In diagonals.
    """
    allowed = bound * (1.0 - MARGIN)
    step = np.float32(STEP_OF_BOUND * allowed)
    squared = np.einsum("tvc,tvc->tv", errors, errors)
    vertices, frames = np.nonzero(allowed**2 < squared.T)
    offsets = np.rint(errors[frames, vertices] / float(step)).astype(np.int64)
    return Corrections(step, vertices.astype(np.int64), frames.astype(np.int64), offsets)
