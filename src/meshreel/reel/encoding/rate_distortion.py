"""Rate-distortion optimised quantisation."""

import numpy as np
import numpy.typing as npt

from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FAIR_PRICE = 2.0 * np.log(2.0) / 12.0
"""Lagrange multiplier of fine rounding: the squared steps of error that one more bit saves."""

N_ROUNDS = 2
FIRST_DEAD_ZONE = 0.6
LATER_ZONE = 0.04
"""By how much more than half a step magnitudes above 1 are rounded down."""

LONG_ROW = 2000
"""Rows of more values than this are counted faster one by one."""


@staged("rounding")
def quantize_by_rate(scaled: Floats, price: float) -> Integers:
    """Integers near to values in steps; those that cost more bits than they are worth are 0.

    A value r that becomes 1 instead of 0 saves r^2 - (1 - r)^2 of squared error and costs the
    difference of their code lengths, which is taken from how often the two occur in its column:
    values below (1 + price x difference) / 2 become 0.

    Parameters
    ----------
    scaled : float64 array of shape (n, K)
        Each column has statistics of its own.
    price : float
        Squared steps that a bit is worth; 0 rounds to the nearest.

    Returns
    -------
    int64 array of shape (n, K)

    References
    ----------
    G. J. Sullivan, T. Wiegand, "Rate-distortion optimization for video compression", IEEE Signal
    Processing Magazine, 1998.
    """
    if price == 0.0:
        return np.rint(scaled).astype(np.int64)
    magnitudes = np.abs(scaled)
    columns = np.ascontiguousarray(magnitudes.T)
    n_small = _counts_below(columns, np.full(len(columns), 1.5))
    zone = np.full(len(columns), FIRST_DEAD_ZONE)
    for _ in range(N_ROUNDS):
        n_zeros = _counts_below(columns, zone)
        n_ones = n_small - n_zeros
        # Half an observation each, so that a column without any has a length too.
        extra_bits = np.log2((n_zeros + 0.5) / (0.5 * n_ones + 0.5))
        zone = np.clip(0.5 + 0.5 * price * extra_bits, 0.5, 1.0)
    rounded = np.maximum(np.floor(magnitudes + (0.5 - LATER_ZONE)), 1.0)
    rounded[magnitudes < zone] = 0.0
    return np.copysign(rounded, scaled, out=rounded).astype(np.int64)


def _counts_below(columns: Floats, limits: Floats) -> Integers:
    """How many values of each row of an array of shape (K, n) are below its limit."""
    below = columns < limits[:, None]
    if below.shape[1] < LONG_ROW:
        return np.asarray(below.sum(axis=1))
    return np.array([np.count_nonzero(row) for row in below], np.int64)
