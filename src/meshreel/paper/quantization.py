"""Uniform quantization (paper Eq. 10), and the bits of each row of coefficients.

# Deviation from Eq. 10: the paper leaves open the quantizer Q and the allocation of bits to the
k_l rows. Implemented are one step for all rows, a step for each row, and bits for each row.
The first is the default: the basis is orthonormal, so equal steps give the least squared error
for a number of bits.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import InvalidInputError

Steps = npt.NDArray[np.float32]


def uniform_step(largest: float, bits: int) -> float:
    """Quantization step that maps a magnitude to the largest signed integer of `bits` bits.

    Parameters
    ----------
    bits : int
        2..24, or 0: no bits, and a step of 0.
    """
    return 0.0 if bits == 0 else largest / (2 ** (bits - 1) - 1)


def step_for_all_rows(values: Floats, bits: int) -> Steps:
    """One quantization step for all rows, with which the largest magnitude takes `bits` bits.

    A row of magnitude m then takes about bits - log2(largest / m): bits follow energy.

    Parameters
    ----------
    values : float64 array of shape (3, rows, columns)

    Returns
    -------
    float32 array of shape (1,)
    """
    largest = float(np.abs(values).max(initial=0.0))
    return np.array([uniform_step(largest, bits)], np.float32)


def steps_for_each_row(values: Floats, bits: int | Sequence[int]) -> Steps:
    """A quantization step for each row, with which its largest magnitude takes its bits.

    Parameters
    ----------
    values : float64 array of shape (3, rows, columns)
    bits : int, or one for each row
        2..24, or 0 for a row that is omitted. Surplus entries of a list are ignored.

    Returns
    -------
    float32 array of shape (rows,)

    Raises
    ------
    InvalidInputError
        If there are fewer numbers than rows.
    """
    magnitudes = np.abs(values).max(axis=(0, 2), initial=0.0)
    row_bits = list(bits) if isinstance(bits, Sequence) else [bits] * len(magnitudes)
    if len(row_bits) < len(magnitudes):
        raise InvalidInputError(
            f"bits lists {len(row_bits)} rows, but there are {len(magnitudes)} modes; give bits "
            f"for each, or n_modes={len(row_bits)}"
        )
    pairs = zip(magnitudes, row_bits, strict=False)
    return np.array([uniform_step(float(size), number) for size, number in pairs], np.float32)


def quantize(values: Floats, steps: Steps) -> Integers:
    """Integers nearest to values / step (paper Eq. 10, for the rows that are kept).

    Parameters
    ----------
    values : float64 array of shape (3, rows, columns)
    steps : float32 array of shape (1,) or (rows,)
        One for all rows, or one for each. Rows of step 0 become zeros. float32 as in the stream, so
        that encoder and decoder use the same values.
    """
    divisors = _broadcast(steps)
    scaled = np.divide(values, divisors, out=np.zeros_like(values), where=divisors > 0)
    return np.rint(scaled).astype(np.int64)


def dequantize(integers: Integers, steps: Steps) -> Floats:
    """Values of the integers, within half a step of the originals."""
    return np.asarray(integers * _broadcast(steps))


def _broadcast(steps: Steps) -> Floats:
    return steps.astype(np.float64)[None, :, None]
