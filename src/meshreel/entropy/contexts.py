"""Contexts of integers: classes that encoder and decoder both know, computed in integers only.

The magnitude expected at a column is the mean magnitude of its pass of the row, times how much the
column stood out so far: in the rows before, and at its neighbours already coded in this row.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]

UNIT = 1 << 20
"""One, in the fixed-point numbers of this file."""

MAX_MEAN_CLASS = 70  # of a mean magnitude of 2^15
MAX_EVIDENCE = (1 << 16) - 1  # larger magnitudes count as this
MEMORY_SHIFT = 3  # with each row, the rows before it lose an eighth of their weight
PRIOR = UNIT // 3  # weight of "like the mean of the row" before anything is known
LOG_PARTS = 8  # parts of an octave
FLOAT_SHIFT = 52 - (LOG_PARTS.bit_length() - 1)  # leaves the octave and its parts of a float64
FLOAT_BIAS = 1023 * LOG_PARTS
N_EXPECTED = 72  # half octaves of the expected magnitude, from 2^-20 on
N_PAST = 6
N_NEAR = 3
PAST_BOUNDS = np.array([2, 5, 9, 15, 24], np.int64) * (UNIT // 5)


@dataclass(frozen=True)
class Contexts:
    """The contexts of n integers, each an integer array of shape (n,).

    Attributes
    ----------
    expected : class of the expected magnitude, in 0..N_EXPECTED-1
    past : class of the magnitudes of the rows before, in 0..N_PAST-1
    near : class of the magnitudes of context neighbours, in 0..N_NEAR-1
    prediction : of the sign; 0 predicts none, and a larger magnitude is more certain
    """

    expected: Integers
    past: Integers
    near: Integers
    prediction: Integers


class Past:
    """Sums over the rows before, with weights that decay with age, in UNIT.

    Attributes
    ----------
    magnitudes : integer array of shape (n_columns,)
        Of every column.
    means : integer array of shape (n_columns,)
        Mean magnitudes of the column's pass in the same rows.
    """

    def __init__(self, n_columns: int) -> None:
        self.magnitudes = np.zeros(n_columns, np.int64)
        self.means = np.zeros(n_columns, np.int64)

    def add(self, magnitudes: Integers, means: Integers) -> None:
        """Add a row: its magnitudes, and for each column the mean of its pass in UNIT."""
        self.magnitudes += UNIT * magnitudes - (self.magnitudes >> MEMORY_SHIFT)
        self.means += means - (self.means >> MEMORY_SHIFT)


def mean_class(magnitudes: Integers) -> int:
    """Class of the mean magnitude, in half octaves: 0 if all are 0, else 1..MAX_MEAN_CLASS."""
    total = int(magnitudes.sum())
    if total == 0:
        return 0
    mean = max(total * UNIT // len(magnitudes), 1)
    octave = mean.bit_length() - 1
    return min(max(2 * octave + ((2 * mean) >> octave & 1), 1), MAX_MEAN_CLASS)


def mean_of_class(classes: Integers) -> Integers:
    """Mean magnitude that represents each class, in UNIT: 5/4 or 7/4 of a power of two."""
    return ((5 + 2 * (classes & 1)) << (classes >> 1)) >> 2


def expected_classes(
    past: Integers, past_mean: Integers, near: Integers, near_mean: Integers, mean: Integers
) -> Integers:
    """Class of the expected magnitude of each of n columns in some rows, in 0..N_EXPECTED-1.

    Parameters
    ----------
    past, past_mean : integer arrays of shape (n, 1)
        Magnitudes of the rows before, and means of the pass in them, in UNIT (`Past`).
    near, near_mean : integer arrays of shape (n, rows)
        Sums over the context neighbours: of their magnitudes, and of the means of their passes, in
        UNIT.
    mean : integer array of shape (rows,)
        Mean magnitude of the pass in each row, in UNIT.

    Returns
    -------
    integer array of shape (n, rows)
    """
    seen = PRIOR + (past >> 1) + UNIT * near
    usual = PRIOR + (past_mean >> 1) + near_mean
    logs = _logarithms(mean) + (_logarithms(seen) - _logarithms(usual))
    classes = logs // (LOG_PARTS // 2)
    return np.asarray(np.minimum(np.maximum(classes, 0), N_EXPECTED - 1))


def past_classes(past: Integers) -> Integers:
    """Class of the magnitudes of the rows before, in 0..N_PAST-1."""
    return np.searchsorted(PAST_BOUNDS, past, side="right")


def near_classes(near: Integers) -> Integers:
    """Class of the magnitudes of context neighbours, in 0..N_NEAR-1."""
    return np.minimum(near, N_NEAR - 1)


def _logarithms(values: Integers) -> Integers:
    """Logarithms of positive integers to base 2, in units of 1 / LOG_PARTS, piecewise linear."""
    # The conversion to float64 rounds alike on every machine. Its highest bits are the octave and,
    # below it, the fraction of the octave; a positive number has no sign.
    bits: Integers = values.astype(np.float64).view(np.int64)
    return (bits >> FLOAT_SHIFT) - FLOAT_BIAS
