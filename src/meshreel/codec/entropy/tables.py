"""Lossless coding of tables of numbers, as integers or by their bit patterns.

The floats of many files are integers divided by a common divisor, or on a grid.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.patterns import (
    encode_patterns,
    face_predictors,
    no_predictors,
    previous_predictors,
)
from meshreel.kernel.surface_integers import MAX_VALUE, encode_on_surface

Int32s = npt.NDArray[np.int32]
Integers = npt.NDArray[np.integer]
Numbers = npt.NDArray[Any]
Faces = npt.NDArray[np.int32]
Forms = list[tuple[bytes, Numbers]]

MAX_DECIMALS = 9

UNORM8, UNORM16 = 10, 11
"""Codes of the divisors 255 and 65535; codes up to `MAX_DECIMALS` count decimal places."""

GRID = 64
"""Code of the grid of whole numbers; the next codes are grids of 1/2, 1/4, ..."""

MAX_GRID_BITS = 24
"""Finest grid, of 2^-bits; float32 represents all of its numbers up to 1."""

MAX_INTEGER = 1 << 29

OFFSET_GRID = 12
"""Code of a grid whose step and origins are stored, such as that of Draco's quantization."""

QUANTIZED_BITS = range(4, 21)
"""Bits of such grids."""

N_SAMPLED_ROWS = 64
"""Number of rows on which a grid is tested first."""

BIT_PATTERNS = 255
"""First byte of a table that is not stored as multiples."""

ALONG_FACES, ON_SURFACE, FROM_POINTS = 2, 3, 4
"""Codes of predictors of a row; 0 and 1 are those without faces."""

SMALL_TABLE, FEW_ROWS = 10_000, 0.5
"""Rows of a table up to which all predictors are tried; share of distinct rows below which the
order of a larger table may predict better than its faces."""

INTEGER = np.dtype(np.int32)


def encode_table(
    values: Numbers, faces: Faces | None = None, points: Numbers | None = None
) -> bytes:
    """Encode a table of shape (N, C) losslessly.

    Parameters
    ----------
    values : array of uint8, int32, float32 or float64
    faces : int32 array of shape (M, 3), optional
        Triangles of rows, for predictions from neighboring rows. The reader needs the same.
    points : array of shape (N, 3), optional
        Positions of the rows, with which rows of triangles are predicted from points only.
    """
    forms = [(bytes([BIT_PATTERNS]), values)]
    forms += [(bytes([code]), integers) for code, integers in as_multiples(values)]
    forms += [(bytes([OFFSET_GRID]) + grid, integers) for grid, integers in as_offset_grid(values)]
    return _shortest(forms, faces, points)


def encode_grid_table(
    integers: Integers, bits: int, faces: Faces | None = None, points: Numbers | None = None
) -> bytes:
    """Encode a table of shape (N, C) of integer multiples of 2^-bits, as `encode_table`."""
    return _shortest([(bytes([GRID + bits]), integers.astype(INTEGER))], faces, points)


def _shortest(forms: Forms, faces: Faces | None, points: Numbers | None) -> bytes:
    """Encode a table by the form and prediction that take the fewest bytes."""
    return min(_trials(forms, faces, points), key=len)


def _trials(forms: Forms, faces: Faces | None, points: Numbers | None) -> Iterator[bytes]:
    """Yield the table in each form, with each predictor."""
    table = forms[0][1]
    n_rows = len(table)
    if faces is not None and points is not None:
        placed = face_predictors(faces, opposite_sides(faces, n_rows), n_rows, points)
        for form, numbers in forms:
            yield form + bytes([FROM_POINTS]) + encode_patterns(numbers, placed)
        return
    n_distinct = 0 if faces is None else len(np.unique(rows_as_bytes(table)))
    if n_rows <= SMALL_TABLE or n_distinct < FEW_ROWS * n_rows:
        for code, predictors_of in enumerate((no_predictors, previous_predictors)):
            for form, numbers in forms:
                yield form + bytes([code]) + encode_patterns(numbers, predictors_of(n_rows))
    if faces is None:
        return
    twins = opposite_sides(faces, n_rows)
    along = face_predictors(faces, twins, n_rows)
    for form, numbers in forms:
        yield form + bytes([ALONG_FACES]) + encode_patterns(numbers, along)
        if numbers.dtype == INTEGER and -MAX_VALUE <= numbers.min() <= numbers.max() <= MAX_VALUE:
            yield form + bytes([ON_SURFACE]) + encode_on_surface(numbers[None], faces, twins)


def divisor(code: int) -> float:
    """Divisor of integers with this code."""
    if code >= GRID:
        return 2.0 ** (code - GRID)
    return {UNORM8: 255.0, UNORM16: 65535.0}.get(code) or 10.0**code


def values_of(integers: Int32s, code: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Floats that integers with this code represent."""
    # One division of exact numbers and one rounding: the same on every machine.
    return (integers / divisor(code)).astype(dtype)


def as_multiples(values: npt.NDArray[Any]) -> Iterator[tuple[int, Int32s]]:
    """Yield codes and integers that represent these floats exactly: the coarsest of each family."""
    if values.dtype.kind != "f" or not np.isfinite(values).all():
        return
    exact = values.astype(np.float64)
    grids = range(GRID, GRID + MAX_GRID_BITS + 1)
    for family in (range(MAX_DECIMALS + 1), (UNORM8, UNORM16), grids):
        for code in family:
            integers = _integers(values, exact, code)
            if integers is not None:
                yield code, integers
                break


def _integers(values: npt.NDArray[Any], exact: npt.NDArray[Any], code: int) -> Int32s | None:
    with np.errstate(over="ignore"):
        rounded = np.rint(exact * divisor(code))
    if not (np.abs(rounded) <= MAX_INTEGER).all():
        return None
    integers = rounded.astype(np.int32)
    restored = values_of(integers, code, values.dtype)
    return integers if restored.tobytes() == values.tobytes() else None


def as_offset_grid(values: npt.NDArray[Any]) -> Iterator[tuple[bytes, Int32s]]:
    """Yield the step and origins, and integers, that represent these floats exactly; or nothing.

    A quantizer of b bits divides the widest range of a column into 2^b - 1 steps, and rounds
    products and sums to single precision, as Draco does.

    Parameters
    ----------
    values : array of shape (N, C)
    """
    if values.dtype != np.float32 or not len(values) or not np.isfinite(values).all():
        return
    low = values.min(axis=0)
    with np.errstate(over="ignore"):
        width = (values.max(axis=0) - low).max()
    for bits in QUANTIZED_BITS if 0 < width < np.inf else ():
        step = width / np.float32(2**bits - 1)  # may underflow to 0
        if not step or _on_grid(values[:N_SAMPLED_ROWS], low, step) is None:
            continue
        integers = _on_grid(values, low, step)
        if integers is not None:
            yield np.append(step, low).astype("<f4").tobytes(), integers
            return


def _on_grid(
    values: npt.NDArray[np.float32], low: npt.NDArray[np.float32], step: np.float32
) -> Int32s | None:
    """Return the integers of values on a grid, or None if they are not all on it."""
    with np.errstate(over="ignore", invalid="ignore"):
        integers = np.rint((values.astype(np.float64) - low) / step).astype(np.int32)
        restored = low + integers.astype(np.float32) * step
    return integers if restored.tobytes() == values.tobytes() else None
