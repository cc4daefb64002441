"""Lossless coder of tables of numbers: as decimals, on a grid, or as bit patterns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.deflate import MAX_RATIO
from meshreel.entropy.exact import decode_exact, encode_exact
from meshreel.entropy.grid_table import decode_grid, encode_grid
from meshreel.errors import CorruptStreamError, TruncatedStreamError

Integers = npt.NDArray[np.int64]

MOST_PLACES = 9
"""Most decimal places that are tried; values with more are coded as bit patterns."""

PATTERNS = 255
"""Code in place of the number of decimal places: values are bit patterns."""

GRID = 254
"""Code in place of the number of decimal places: values are on a grid of 2^-bits."""

LARGEST = 1 << 29
"""Largest decimal without its point, so that differences can be coded."""


def encode_table(values: npt.NDArray[Any]) -> bytes:
    """Bytes of a table of shape (N, C), exactly.

    Numbers in files are often decimals of a few places. Then their integer multiples of 10^-places
    are coded, column by column, as differences.
    """
    patterns = bytes([PATTERNS]) + encode_exact(values)
    found = _decimals(values)
    if found is None:
        return patterns
    places, integers = found
    decimals = bytes([places]) + encode_integers(list(np.diff(integers, axis=0, prepend=0).T))
    return min(decimals, patterns, key=len)


def encode_grid_table(integers: Integers, bits: int) -> bytes:
    """Bytes of a table of shape (N, C) of integer multiples of 2^-bits."""
    return bytes([GRID]) + encode_grid(integers, bits)


def decode_table(data: bytes, shape: tuple[int, int], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """The table that `encode_table` or `encode_grid_table` wrote.

    Nothing is allocated that the bytes cannot hold.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not those of a table of this shape and type.
    """
    if not data:
        raise TruncatedStreamError("a table of values has no bytes")
    places, packed = data[0], data[1:]
    n_rows, width = shape
    if places == GRID:
        return decode_grid(packed, shape, dtype)
    if places == PATTERNS:
        if n_rows * width * dtype.itemsize > MAX_RATIO * len(packed):
            raise CorruptStreamError(
                f"a table of {n_rows} x {width} values is announced; {len(packed)} bytes "
                "cannot hold it"
            )
        return decode_exact(packed, shape, dtype)
    if places > MOST_PLACES:
        raise CorruptStreamError(f"{places} decimal places; at most {MOST_PLACES} are allowed")
    differences = decode_integers(packed, [n_rows] * width)
    return _scaled(np.cumsum(np.stack(differences, axis=1), axis=0), places, dtype)


def _decimals(values: npt.NDArray[Any]) -> tuple[int, Integers] | None:
    """The fewest decimal places that give exactly these values, and the integers; else None."""
    if not np.isfinite(values).all():
        return None
    exact = values.astype(np.float64)
    for places in range(MOST_PLACES + 1):
        with np.errstate(over="ignore"):
            rounded = np.rint(exact * 10.0**places)
        if not (np.abs(rounded) <= LARGEST).all():  # nor for more places
            return None
        integers = rounded.astype(np.int64)
        if _scaled(integers, places, values.dtype).tobytes() == values.tobytes():
            return places, integers
    return None


def _scaled(integers: Integers, places: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    # One division of exact numbers and one rounding: the same on every machine.
    return (integers / 10.0**places).astype(dtype)
