"""Lossless coder of tables whose numbers lie on a grid of 2^-bits."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.errors import CorruptStreamError, TruncatedStreamError

Integers = npt.NDArray[np.int64]

MAX_GRID_BITS = 24
"""Finest grid; every number of it up to 1 is exact in float32."""

LARGEST = 1 << 29
"""Largest number in units of the grid, so that differences can be coded."""


def encode_grid(integers: Integers, bits: int) -> bytes:
    """Bytes of a table of shape (N, C), in units of 2^-bits.

    The numbers of a column are coded as they are or as differences, whichever is smaller.
    """
    coded = (
        bytes([bits, order]) + encode_integers(list(_differenced(integers, order).T))
        for order in (1, 0)
    )
    return min(coded, key=len)


def decode_grid(data: bytes, shape: tuple[int, int], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """The table that `encode_grid` wrote; nothing is allocated that the bytes cannot hold.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not those of a table of this shape.
    """
    if len(data) < 2:
        raise TruncatedStreamError("a table on a grid ends inside its first two bytes")
    bits, order = data[:2]
    if bits > MAX_GRID_BITS or order > 1 or dtype.kind != "f":
        raise CorruptStreamError(
            f"a table of {dtype} is on a grid of {bits} bits, differenced {order} times; "
            f"floats on up to {MAX_GRID_BITS} bits, differenced once at most, are allowed"
        )
    n_rows, width = shape
    integers = np.stack(decode_integers(data[2:], [n_rows] * width), axis=1)
    return grid_values(np.cumsum(integers, axis=0) if order else integers, bits, dtype)


def grid_values(integers: Integers, bits: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Values of integers in units of 2^-bits."""
    return np.ldexp(integers.astype(np.float64), -bits).astype(dtype)


def _differenced(integers: Integers, order: int) -> Integers:
    return np.diff(integers, axis=0, prepend=0) if order else integers
