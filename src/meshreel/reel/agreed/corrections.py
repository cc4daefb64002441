"""Corrections of single positions, so that a largest error can be promised.

After a block is decoded, the positions that lie beyond the bound are moved by whole steps. They
stand together in vertices and runs of frames, and are coded so.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.paper.pipeline import FramesOf
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

STEP_OF_BOUND = 1.1
"""Step of corrections by the bound: half of it along each axis is 0.95 of the bound away."""

LARGEST_STEP = 1.0
"""Steps need not be larger: no vertex is farther than a diagonal from where it should be."""

MARGIN = 1e-3
"""Share of the bound that is kept free, for what another machine computes in its last bits."""

FLOOR = 2.0**-28
"""Diagonals that are kept free at least, a 32nd of the unit of float32: weights that differ in
their last bits move positions by 5e-13 diagonals on captured and simulated sequences, and by 2e-9
where weights are so large that they amplify rounding."""


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


def allowed_error(bound: float, rounding: float) -> float:
    """What is left of a bound for errors of the codec, in diagonals."""
    return bound - max(bound * MARGIN, FLOOR) - rounding


def least_bound(rounding: float) -> float:
    """The bound, in diagonals, that leaves nothing for errors of the codec; see `allowed_error`."""
    return max(rounding / (1.0 - MARGIN), rounding + FLOOR)


@staged("corrections")
def find_corrections(errors: Floats, bound: float, rounding: float) -> Corrections:
    """What brings all positions of a block within a bound.

    Parameters
    ----------
    errors : float64 array of shape (3, T, V)
        True coordinates less decoded ones, in diagonals; vertices in internal order.
    bound : float
        In diagonals.
    rounding : float
        Largest error of a position that comes from its number type alone.
    """
    allowed = allowed_error(bound, rounding)
    step = np.float32(min(STEP_OF_BOUND * allowed, LARGEST_STEP))
    squared = np.einsum("ctv,ctv->tv", errors, errors)
    vertices, frames = np.nonzero(allowed**2 < squared.T)
    offsets = np.rint(errors[:, frames, vertices].T / float(step)).astype(np.int64)
    return Corrections(step, vertices.astype(np.int64), frames.astype(np.int64), offsets)


@staged("corrections")
def corrected(frames_of: FramesOf, corrections: Corrections, order: Integers | None) -> FramesOf:
    """What gives frames with their corrections.

    Parameters
    ----------
    frames_of : callable
        Gives coordinate matrices of shape (3, frames, V) of a range of frames.
    corrections : Corrections
    order : integer array of shape (V,), or None
        Internal number of each vertex that `frames_of` gives; None if they are in internal order.
    """
    by_frame = np.argsort(corrections.frames, kind="stable")
    frames, moves = corrections.frames[by_frame], corrections.moves[by_frame]
    places = corrections.vertices if order is None else np.argsort(order)[corrections.vertices]
    places = places[by_frame]

    def corrected_frames_of(wanted: slice) -> Floats:
        matrices = frames_of(wanted)
        start = wanted.start or 0
        rows = slice(*np.searchsorted(frames, (start, start + matrices.shape[1])))
        matrices[:, frames[rows] - start, places[rows]] += moves[rows].T
        return matrices

    return corrected_frames_of
