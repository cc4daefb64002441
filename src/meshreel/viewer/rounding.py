"""Numbers rounded to few digits: the zeros behind them deflate to almost nothing."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

DROPPED_BITS = 16
"""Of the 23 that a float32 has behind its leading one; 7 are left, which is 0.4 %."""


def rounded_to(values: npt.NDArray[np.floating], largest_step: npt.ArrayLike) -> Floats:
    """Values rounded to multiples of the largest power of two that is not above a step.

    Parameters
    ----------
    values : float array
    largest_step : positive float, or array of them that fits the values
    """
    steps = 2.0 ** np.floor(np.log2(largest_step))
    return np.asarray(np.rint(values / steps) * steps)


def two_digits(values: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
    """Values of at least 0, each rounded to within 0.4 % of itself."""
    bits = values.astype(np.float32).view(np.uint32)
    half = np.uint32(1 << (DROPPED_BITS - 1))
    return np.asarray(((bits + half) >> DROPPED_BITS) << DROPPED_BITS).view(np.float32)
