"""Lossless coding of tables of numbers, as multiples of a fraction or by their bit patterns."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.codec.entropy.multiples import GRID, OFFSET_GRID, as_multiples, as_offset_grid
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.patterns import (
    encode_patterns,
    face_predictors,
    no_predictors,
    previous_predictors,
)
from meshreel.kernel.surface_integers import MAX_VALUE, encode_on_surface

Integers = npt.NDArray[np.integer]
Numbers = npt.NDArray[Any]
Faces = npt.NDArray[np.int32]
Forms = list[tuple[bytes, Numbers]]

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
