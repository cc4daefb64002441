"""Fields as integers of base 15, whose digits are rows of a texture.

A field has one scale and 1 to 5 digits from -7 to 7, so that its integers go from -L to L with
``L = (15**n - 1) / 2``. Two digits share a byte, each plus 8: no byte is 0, which programs that
import images take for a transparent pixel whose colours they may change.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles

Digits = npt.NDArray[np.int8]

BASE = 15
MOST_DIGITS = 5
REACH = 7
"""The largest digit."""

ROWS = 8
"""Digits that a texel of four bytes holds, all of one coordinate of one vertex."""


def largest_integer(n_digits: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The largest integer of so many digits, ``(15**n - 1) / 2``."""
    return (BASE**n_digits - 1) // 2


@dataclass(frozen=True, eq=False)
class Fields:
    """Integers of the fields, and their weights: frames are ``weights @ integers``.

    Attributes
    ----------
    integers : int32 array of shape (K, N)
    weights : float32 array of shape (T, K)
    n_digits : int64 array of shape (K,)
        Of the integers of each field.
    """

    integers: npt.NDArray[np.int32]
    weights: Singles
    n_digits: npt.NDArray[np.int64]

    @property
    def n_texels(self) -> int:
        """Texels that a coordinate of a vertex takes."""
        return -(-int(self.n_digits.sum()) // ROWS)


@dataclass(frozen=True, eq=False)
class Rows:
    """Digits and weights as textures hold them.

    Attributes
    ----------
    pairs : int8 array of shape (4 P, 2, N)
        Rows of two digits, the upper one first, that have one weight: ``15 upper + lower``.
    singles : int8 array of shape (8 S, N)
        Rows of one digit.
    weights : float32 array of shape (T, 4 P + 8 S)
        Of the pairs, then of the singles; zeros for rows that only fill a texel.
    """

    pairs: Digits
    singles: Digits
    weights: Singles

    @property
    def n_pair_texels(self) -> int:
        """Texels of pairs of a coordinate of a vertex, P."""
        return len(self.pairs) // (ROWS // 2)

    @property
    def n_single_texels(self) -> int:
        """Texels of single digits of a coordinate of a vertex, S."""
        return len(self.singles) // ROWS


def rows_of(fields: Fields) -> Rows:
    """The rows of fields: digits in pairs from the upper end, four pairs a texel, others alone."""
    n_frames, size = len(fields.weights), fields.integers.shape[1]
    pairs: list[tuple[Digits, Singles]] = []
    singles: list[tuple[Digits, Singles]] = []
    for integers, weights, n_digits in zip(
        fields.integers, fields.weights.T, fields.n_digits, strict=True
    ):
        digits = split(integers, int(n_digits))
        exponents = range(int(n_digits) - 1, -1, -1)
        scaled = [weights * np.float32(BASE**exponent) for exponent in exponents]
        for upper in range(0, int(n_digits) - 1, 2):
            pairs.append((digits[upper : upper + 2], scaled[upper + 1]))
        if n_digits % 2:
            singles.append((digits[-1], scaled[-1]))
    n_whole = len(pairs) - len(pairs) % (ROWS // 2)
    for both, weights in pairs[n_whole:]:
        singles += [(both[0], weights * np.float32(BASE)), (both[1], weights)]
    n_singles = -(-len(singles) // ROWS) * ROWS
    rows = np.zeros((n_singles, size), np.int8)
    table = np.zeros((n_frames, n_whole + n_singles), np.float32)
    for number, (row, weights) in enumerate(singles):
        rows[number], table[:, n_whole + number] = row, weights
    whole = np.zeros((n_whole, 2, size), np.int8)
    for number, (both, weights) in enumerate(pairs[:n_whole]):
        whole[number], table[:, number] = both, weights
    return Rows(whole, rows, table)


def split(integers: npt.NDArray[np.int32], n_digits: int) -> Digits:
    """Digits from -7 to 7 of integers of shape (N,), the uppermost first: shape (n, N)."""
    digits = np.empty((n_digits, *integers.shape), np.int8)
    left = integers.astype(np.int64)
    for place in range(n_digits - 1, -1, -1):
        upper = np.floor_divide(left + REACH, BASE)
        digits[place] = left - BASE * upper
        left = upper
    return digits


def shared_digits(energies: Floats, steps: Floats, n_texels: int) -> npt.NDArray[np.int64]:
    """The digits of each field that leave the least squared error in so many texels.

    Without digits a field leaves its energy; with n of them, ``step**2 / (15**n - 1)**2`` from
    rounding. Digits go one after the other to where they take away most, a field at a time by the
    best mean gain of its next digits.

    Parameters
    ----------
    energies : float64 array of shape (K,)
        Sums of squares, descending.
    steps : float64 array of shape (K,)
        Sums of squared rounding errors times ``(15**n - 1)**2``.
    n_texels : int
    """
    errors = _errors(energies, steps)
    # The lower convex hull of each row: gains by digit descend along it.
    moves = sorted(
        (
            (gain, field, n_before, n_after)
            for field, row in enumerate(errors)
            for gain, n_before, n_after in _hull(row)
        ),
        key=lambda one: (-one[0], one[1], one[2]),
    )
    left = n_texels * ROWS
    n_digits = np.zeros(len(energies), np.int64)
    for _, field, n_before, n_after in moves:
        if n_digits[field] == n_before and n_after - n_before <= left:
            n_digits[field] = n_after
            left -= n_after - n_before
    return n_digits


def texels_for(energies: Floats, steps: Floats, allowed: float) -> int:
    """The least number of texels with which the sum of squared errors is at most `allowed`."""
    errors = _errors(energies, steps)
    left = float(energies.sum())
    n_digits = 0
    moves = [(gain, n_after - n_before) for row in errors for gain, n_before, n_after in _hull(row)]
    for gain, n_more in sorted(moves, reverse=True):
        if left <= allowed:
            break
        left -= gain * n_more
        n_digits += n_more
    return -(-n_digits // ROWS)


def _errors(energies: Floats, steps: Floats) -> Floats:
    """Squared errors of every field with 0 to `MOST_DIGITS` digits, of shape (K, 1 + most)."""
    counts = np.arange(1, MOST_DIGITS + 1)
    return np.column_stack([energies, steps[:, None] / (BASE**counts - 1.0) ** 2])


def _hull(errors: Floats) -> list[tuple[float, int, int]]:
    """Steps along the lower convex hull: the gain by digit, and the counts before and after."""
    found = []
    at = 0
    while at < len(errors) - 1:
        counts = np.arange(at + 1, len(errors))
        gains = (errors[at] - errors[counts]) / (counts - at)
        best = int(gains.argmax())
        if gains[best] <= 0:
            break
        found.append((float(gains[best]), at, int(counts[best])))
        at = int(counts[best])
    return found
