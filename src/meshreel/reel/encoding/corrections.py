"""Corrections that keep a promised largest error, and bounds that can be promised."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]

STEP_OF_BOUND = 1.1
"""Step of corrections by the bound: half of it along each axis is 0.95 of the bound away."""


LARGEST_STEP = 1.0
"""Steps need not be larger: no vertex is farther than a diagonal from where it should be."""


MARGIN = 1e-3
"""Share of the bound that is kept free, for the last bits of another machine's arithmetic."""


FLOOR = 2.0**-28
"""Diagonals that are kept free at least, a 32nd of the unit of float32: weights that differ in
their last bits move positions by 5e-13 diagonals on captured and simulated sequences, and by 2e-9
where weights are so large that they amplify rounding."""


def allowed_error(bound: float, rounding: float) -> float:
    """The part of a bound that is left for errors of the codec, in diagonals."""
    return bound - max(bound * MARGIN, FLOOR) - rounding


def least_bound(rounding: float) -> float:
    """The bound, in diagonals, that leaves nothing for errors of the codec; see `allowed_error`."""
    return max(rounding / (1.0 - MARGIN), rounding + FLOOR)


@staged("corrections")
def find_corrections(errors: Floats, bound: float, rounding: float) -> Corrections:
    """Corrections that bring all positions of a block within a bound.

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
