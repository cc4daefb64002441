"""Fields as integers in balanced base 15, whose digits are rows of a texture.

A field has one scale and 1 to 5 digits from -7 to 7, so that its integers go from -L to L with
``L = (15**n - 1) / 2``. Two digits share a byte, each plus 8. No byte is 0: some programs treat a
pixel with alpha 0 as transparent and change its colors on import.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles

Digits = npt.NDArray[np.int8]

BASE = 15
MAX_DIGITS = 5
MAX_DIGIT = 7

DIGITS_PER_TEXEL = 8
"""Digits in a texel of four bytes, all of the same coordinate of a vertex."""


def largest_integer(n_digits: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the largest integer with `n_digits` digits, ``(15**n - 1) / 2``."""
    return (BASE**n_digits - 1) // 2


@dataclass(frozen=True, eq=False)
class Fields:
    """Integer fields and their weights: frames are ``weights @ integers``.

    Attributes
    ----------
    integers : int32 array of shape (K, N)
    weights : float32 array of shape (T, K)
    n_digits : int64 array of shape (K,)
        Number of digits of each field.
    """

    integers: npt.NDArray[np.int32]
    weights: Singles
    n_digits: npt.NDArray[np.int64]

    @property
    def n_texels(self) -> int:
        """Texels per coordinate of a vertex."""
        return -(-int(self.n_digits.sum()) // DIGITS_PER_TEXEL)


@dataclass(frozen=True, eq=False)
class DigitRows:
    """Digits and weights in the arrangement of the texture.

    Attributes
    ----------
    pairs : int8 array of shape (4 P, 2, N)
        Upper and lower digits that share a weight: ``15 upper + lower``.
    singles : int8 array of shape (8 S, N)
        Digits with a weight each.
    weights : float32 array of shape (T, 4 P + 8 S)
        Weights of the pairs, then of the single digits; zero for digits that pad a texel.
    """

    pairs: Digits
    singles: Digits
    weights: Singles

    @property
    def n_pair_texels(self) -> int:
        """Texels of pairs per coordinate of a vertex, P."""
        return len(self.pairs) // (DIGITS_PER_TEXEL // 2)

    @property
    def n_single_texels(self) -> int:
        """Texels of single digits per coordinate of a vertex, S."""
        return len(self.singles) // DIGITS_PER_TEXEL


def digit_rows(fields: Fields) -> DigitRows:
    """Return the digits of fields: pairs from the upper end in whole texels, then singles."""
    n_frames, size = len(fields.weights), fields.integers.shape[1]
    pairs: list[tuple[Digits, Singles]] = []
    singles: list[tuple[Digits, Singles]] = []
    for integers, weights, n_digits in zip(
        fields.integers, fields.weights.T, fields.n_digits, strict=True
    ):
        digits = split_digits(integers, int(n_digits))
        exponents = range(int(n_digits) - 1, -1, -1)
        scaled = [weights * np.float32(BASE**exponent) for exponent in exponents]
        for upper in range(0, int(n_digits) - 1, 2):
            pairs.append((digits[upper : upper + 2], scaled[upper + 1]))
        if n_digits % 2:
            singles.append((digits[-1], scaled[-1]))
    n_pairs = len(pairs) - len(pairs) % (DIGITS_PER_TEXEL // 2)
    for both, weights in pairs[n_pairs:]:
        singles += [(both[0], weights * np.float32(BASE)), (both[1], weights)]
    n_singles = -(-len(singles) // DIGITS_PER_TEXEL) * DIGITS_PER_TEXEL
    rows = np.zeros((n_singles, size), np.int8)
    table = np.zeros((n_frames, n_pairs + n_singles), np.float32)
    for number, (row, weights) in enumerate(singles):
        rows[number], table[:, n_pairs + number] = row, weights
    packed_pairs = np.zeros((n_pairs, 2, size), np.int8)
    for number, (both, weights) in enumerate(pairs[:n_pairs]):
        packed_pairs[number], table[:, number] = both, weights
    return DigitRows(packed_pairs, rows, table)


def split_digits(integers: npt.NDArray[np.int32], n_digits: int) -> Digits:
    """Return the digits of integers of shape (N,), most significant first, of shape (n, N)."""
    digits = np.empty((n_digits, *integers.shape), np.int8)
    remaining = integers.astype(np.int64)
    for place in range(n_digits - 1, -1, -1):
        upper = np.floor_divide(remaining + MAX_DIGIT, BASE)
        digits[place] = remaining - BASE * upper
        remaining = upper
    return digits


def allocate_digits(energies: Floats, coefficients: Floats, n_texels: int) -> npt.NDArray[np.int64]:
    """Return the number of digits per field with the smallest squared error in `n_texels`.

    A field without digits leaves its energy as error; with n digits it leaves the rounding error
    ``coefficient / (15**n - 1)**2``. Digits are added greedily by gain per digit, along the lower
    convex hull of each field's error.

    Parameters
    ----------
    energies : float64 array of shape (K,)
        Sums of squares, descending.
    coefficients : float64 array of shape (K,)
        Sums of squared rounding errors times ``(15**n - 1)**2``.
    """
    errors = _errors(energies, coefficients)
    # Along the lower convex hull, gains per digit descend.
    upgrades = sorted(
        (
            (gain, field, n_before, n_after)
            for field, row in enumerate(errors)
            for gain, n_before, n_after in _hull(row)
        ),
        key=lambda one: (-one[0], one[1], one[2]),
    )
    remaining = n_texels * DIGITS_PER_TEXEL
    n_digits = np.zeros(len(energies), np.int64)
    for _, field, n_before, n_after in upgrades:
        if n_digits[field] == n_before and n_after - n_before <= remaining:
            n_digits[field] = n_after
            remaining -= n_after - n_before
    return n_digits


def min_texels(energies: Floats, coefficients: Floats, allowed: float) -> int:
    """Return the smallest number of texels whose sum of squared errors is at most `allowed`."""
    errors = _errors(energies, coefficients)
    error = float(energies.sum())
    n_digits = 0
    upgrades = [
        (gain, n_after - n_before) for row in errors for gain, n_before, n_after in _hull(row)
    ]
    for gain, n_more in sorted(upgrades, reverse=True):
        if error <= allowed:
            break
        error -= gain * n_more
        n_digits += n_more
    return -(-n_digits // DIGITS_PER_TEXEL)


def _errors(energies: Floats, coefficients: Floats) -> Floats:
    """Return squared errors of every field with 0 to `MAX_DIGITS` digits, of shape (K, 1 + max)."""
    counts = np.arange(1, MAX_DIGITS + 1)
    return np.column_stack([energies, coefficients[:, None] / (BASE**counts - 1.0) ** 2])


def _hull(errors: Floats) -> list[tuple[float, int, int]]:
    """Return the segments of the lower convex hull: gain per digit, and digits before and after."""
    segments = []
    start = 0
    while start < len(errors) - 1:
        counts = np.arange(start + 1, len(errors))
        gains = (errors[start] - errors[counts]) / (counts - start)
        best = int(gains.argmax())
        if gains[best] <= 0:
            break
        segments.append((float(gains[best]), start, int(counts[best])))
        start = int(counts[best])
    return segments
