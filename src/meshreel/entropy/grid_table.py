"""Tables of numbers on a grid of 2^-bits to bytes and back, without loss."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.errors import CorruptStreamError, TruncatedStreamError

Integers = npt.NDArray[np.int64]

MAX_GRID_BITS = 24
"""A float32 of up to 1 holds every number of such a grid."""

LARGEST = 1 << 29
"""Numbers in units of the grid are at most this, so that their differences can be coded."""


def encode_grid(integers: Integers, bits: int) -> bytes:
    """Bytes that hold a table of shape (N, C), in units of 2^-bits.

    Each column is coded as it is, or each number less the one before, whichever is smaller.
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
    """What integers in units of 2^-bits stand for."""
    return np.ldexp(integers.astype(np.float64), -bits).astype(dtype)


def _differenced(integers: Integers, order: int) -> Integers:
    return np.diff(integers, axis=0, prepend=0) if order else integers
