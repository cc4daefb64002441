"""Corrections that keep a promised largest error, and bounds that can be promised."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]

STEP_OF_BOUND = 1.1
"""Step of corrections by the bound: half of it along each of three axes is 0.95 of the bound
away."""


LARGEST_STEP = 1.0
"""Steps need not be larger: no vertex is farther than a diagonal from where it should be."""


FLOOR = 2.0**-48
"""Diagonals that are kept free: for the last bits in which a position is moved and scaled. Frames
are the same bits on every machine, so that nothing else is to be feared."""


def allowed_error(bound: float, rounding: float) -> float:
    """The part of a bound that is left for errors of the codec, in diagonals."""
    return bound - FLOOR - rounding


def least_bound(rounding: float) -> float:
    """The bound, in diagonals, that leaves nothing for errors of the codec; see `allowed_error`."""
    return rounding + FLOOR


@staged("corrections")
def find_corrections(
    errors: Floats, bound: float, rounding: float, *, each_column: bool = False
) -> Corrections:
    """Corrections that bring all positions, or values of another track, within a bound.

    Parameters
    ----------
    errors : float64 array of shape (C, T, V)
        True coordinates less decoded ones, in diagonals; vertices in internal order.
    bound : float
        In diagonals.
    rounding : float
        Largest error of a position that comes from its number type alone.
    each_column : bool, default False
        Whether each number by itself has to be within the bound, and not the length of all.
    """
    allowed = allowed_error(bound, rounding)
    n_together = 1 if each_column else len(errors)
    step = np.float32(min(STEP_OF_BOUND * np.sqrt(3.0 / n_together) * allowed, LARGEST_STEP))
    if each_column:
        squared = np.square(np.abs(errors).max(axis=0))
    else:
        squared = np.einsum("ctv,ctv->tv", errors, errors)
    vertices, frames = np.nonzero(allowed**2 < squared.T)
    offsets = np.rint(errors[:, frames, vertices].T / float(step)).astype(np.int64)
    return Corrections(step, vertices.astype(np.int64), frames.astype(np.int64), offsets)
