"""Uniform quantisation (paper Eq. 10)."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Steps = npt.NDArray[np.float32]

MIN_BITS = 2
MAX_BITS = 24


def uniform_step(largest: float, bits: int) -> float:
    """Step with which a largest magnitude takes the largest signed integer of `bits` bits.

    Parameters
    ----------
    largest : float
    bits : int
        2..24, or 0: nothing is kept, and the step is 0.
    """
    return 0.0 if bits == 0 else largest / (2 ** (bits - 1) - 1)


def row_magnitudes(values: Floats) -> Floats:
    """Largest magnitude of each row over all axes, for values of shape (3, rows, columns)."""
    return np.asarray(np.abs(values).max(axis=(0, 2), initial=0.0))


def quantize(values: Floats, steps: Steps) -> Integers:
    """Integers nearest to values / step (paper Eq. 10, for the rows that are kept).

    Parameters
    ----------
    values : float64 array of shape (3, rows, columns)
    steps : float32 array of shape (1,) or (rows,)
        One for all rows, or one for each. Rows of step 0 become zeros. float32 because that is
        what the stream holds: both sides compute with the same value.
    """
    wide = _broadcast(steps)
    scaled = np.divide(values, wide, out=np.zeros_like(values), where=wide > 0)
    return np.rint(scaled).astype(np.int64)


def dequantize(integers: Integers, steps: Steps) -> Floats:
    """Values of the integers: within half a step of what was quantised."""
    return np.asarray(integers * _broadcast(steps))


def _broadcast(steps: Steps) -> Floats:
    return steps.astype(np.float64)[None, :, None]
