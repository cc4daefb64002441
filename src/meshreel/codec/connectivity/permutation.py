"""Orders of 0..n-1, and back."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers


def inverse_permutation(order: npt.NDArray[np.integer]) -> Integers:
    """The index of each of 0..n-1 in `order`."""
    inverse = np.empty(len(order), np.int64)
    inverse[order] = np.arange(len(order))
    return inverse
