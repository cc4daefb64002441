"""Array types shared by the whole package, byte order, repeated values, and rows as bytes."""

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]
Singles = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Vertices = npt.NDArray[np.floating]
"""Positions in single or double precision."""
Real = TypeVar("Real", Floats, Singles)
"""Of functions that compute in the precision of their arguments."""
Values = npt.NDArray[Any]
"""Numbers of any type."""


def native(values: Values) -> Values:
    """Return values in native byte order."""
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def n_equal_before(values: npt.NDArray[np.generic]) -> Integers:
    """Return how many equal values precede each one; `values` has shape (N,)."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    result = np.empty(len(values), np.int64)
    result[order] = np.arange(len(values)) - np.searchsorted(ordered, ordered)
    return result


def rows_as_bytes(*tables: npt.NDArray[np.generic]) -> npt.NDArray[np.void]:
    """Return one item per row with the bytes of that row in all tables.

    Items are equal if all their bits are, and are sorted as unsigned big-endian numbers.

    Parameters
    ----------
    *tables : arrays of shape (N,) or (N, C), of any dtypes
    """
    bytes_of = [
        np.ascontiguousarray(table).view(np.uint8).reshape(len(table), -1) for table in tables
    ]
    rows = np.ascontiguousarray(np.concatenate(bytes_of, axis=1))
    return rows.view(np.dtype((np.void, rows.shape[1])))[:, 0]
