"""Uniform quantisation (paper Eq. 10)."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

MIN_BITS = 2
MAX_BITS = 24


def uniform_step(values: Floats, bits: int) -> np.float32:
    """Step with which the largest magnitude takes the largest signed integer of `bits` bits.

    # Deviation from Eq. 10: the paper leaves the range of Q open. One step serves all rows that
    # are kept, because the basis is orthonormal: equal steps give the least error for the bits
    # spent, and weak rows cost few bits by themselves.

    Parameters
    ----------
    values : float64 array
    bits : int
        2..24.

    Returns
    -------
    float32, in the units of the values; 0 if all of them are 0. float32 because that is what the
    stream holds: both sides compute with the same value.
    """
    largest = float(np.abs(values).max(initial=0.0))
    return np.float32(largest / (2 ** (bits - 1) - 1))


def quantize(values: Floats, step: np.float32) -> Integers:
    """Integers nearest to values / step (paper Eq. 10, for the rows that are kept).

    A step of 0 gives zeros.
    """
    if step == 0:
        return np.zeros(values.shape, np.int64)
    return np.rint(values / float(step)).astype(np.int64)


def dequantize(integers: Integers, step: np.float32) -> Floats:
    """Values of the integers: within half a step of what was quantised."""
    return integers.astype(np.float64) * float(step)
