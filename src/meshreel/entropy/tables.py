"""Tables of numbers to bytes and back without loss: as decimals or on a grid, else bit by bit."""

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
"""Decimal places that are tried; what has more is as good as any bits."""

PATTERNS = 255
"""In place of the number of decimal places: values are bit patterns."""

GRID = 254
"""In place of the number of decimal places: values are on a grid of 2^-bits."""

LARGEST = 1 << 29
"""Decimals without their point are at most this, so that their differences can be coded."""


def encode_table(values: npt.NDArray[Any]) -> bytes:
    """Bytes that hold a table of shape (N, C), exactly.

    What people and programs write is often a decimal of a few places: then it is the integers
    above 10^-places that are coded, column by column, each less the one before.
    """
    patterns = bytes([PATTERNS]) + encode_exact(values)
    found = _decimals(values)
    if found is None:
        return patterns
    places, integers = found
    decimals = bytes([places]) + encode_integers(list(np.diff(integers, axis=0, prepend=0).T))
    return min(decimals, patterns, key=len)


def encode_grid_table(integers: Integers, bits: int) -> bytes:
    """Bytes that hold a table of shape (N, C) of whole numbers of steps of 2^-bits, exactly."""
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
    steps = decode_integers(packed, [n_rows] * width)
    return _scaled(np.cumsum(np.stack(steps, axis=1), axis=0), places, dtype)


def _decimals(values: npt.NDArray[Any]) -> tuple[int, Integers] | None:
    """The fewest decimal places that give these very values, and the integers; None if none do."""
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
