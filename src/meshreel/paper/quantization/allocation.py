"""How many bits each row of coefficients gets, and the steps that follow.

# Deviation from Eq. 10: the paper leaves open what Q does, and how bits are spread over the k_l
rows that are kept. One step for all rows, a step for each, and bits row by row are here; the first
is the default, because the basis is orthonormal: equal steps give the least squared error for the
bits spent.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.paper.quantization.uniform import Steps, row_magnitudes, uniform_step

Floats = npt.NDArray[np.float64]


def step_for_all_rows(values: Floats, bits: int) -> Steps:
    """One step, with which the largest of all magnitudes takes `bits` bits.

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
    """A step for each row, with which its own largest magnitude takes its bits.

    Parameters
    ----------
    values : float64 array of shape (3, rows, columns)
    bits : int, or one for each row
        2..24, or 0 for a row that is left out. Of a longer list the first are used.

    Returns
    -------
    float32 array of shape (rows,)

    Raises
    ------
    InvalidInputError
        If there are fewer numbers than rows.
    """
    magnitudes = row_magnitudes(values)
    each = list(bits) if isinstance(bits, Sequence) else [bits] * len(magnitudes)
    if len(each) < len(magnitudes):
        raise InvalidInputError(
            f"bits lists {len(each)} rows; {len(magnitudes)} modes are kept; give bits for each, "
            f"or n_modes={len(each)}"
        )
    pairs = zip(magnitudes, each, strict=False)
    return np.array([uniform_step(float(size), number) for size, number in pairs], np.float32)
