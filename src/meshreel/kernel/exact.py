"""Numbers over time on a graph to bytes and back, bit for bit, by the core."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call
from meshreel.kernel.mesh import Neighbours

Numbers = npt.NDArray[Any]

TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "f4", "u8", "i8", "f8")
"""Number types, as NumPy writes them; truth values are u1."""

MOST_FRAMES = 1 << 28
BYTES_BESIDE = 16
"""Most bytes that a block takes beyond those of its values."""


def encode_exact(values: Numbers, neighbours: Neighbours) -> bytes:
    """Bytes of a block of numbers over time, from which they come back bit for bit.

    Parameters
    ----------
    values : array of shape (T, N, C)
        Of a type of `TYPES`, or truth values. NaN keep their payloads, zeros their signs.
    neighbours : Neighbours
        Of the N items.

    Raises
    ------
    InvalidInputError
        If the shape, the number type or the neighbours do not fit.
    """
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    dtype = _checked(values.shape, values.dtype, neighbours)
    if values.size == 0:
        return b""
    # A copy, for the core writes what it reads.
    table = np.array(values, dtype, order="C")
    out = np.empty(table.nbytes + BYTES_BESIDE, np.uint8)
    size = call(
        "reel_exact_encode",
        table,
        *_layout(table),
        neighbours.starts,
        neighbours.near,
        out,
        len(out),
        what="values",
        memory_of=("reel_exact_memory", *table.shape),
    )
    return out[:size].tobytes()


def decode_exact(
    data: bytes, shape: tuple[int, int, int], dtype: npt.DTypeLike, neighbours: Neighbours
) -> Numbers:
    """The block that `encode_exact` wrote, of shape (T, N, C); the caller bounds the shape.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of such a block.
    InvalidInputError
        If the shape, the number type or the neighbours do not fit.
    """
    wanted = np.dtype(dtype)
    coded = np.dtype(np.uint8) if wanted.kind == "b" else wanted
    table = np.zeros(shape, _checked(shape, coded, neighbours))
    if table.size == 0:
        if data:
            raise CorruptStreamError(f"a block without values has no bytes; got {len(data)}")
        return table.astype(wanted)
    call(
        "reel_exact_decode",
        data,
        len(data),
        table,
        *_layout(table),
        neighbours.starts,
        neighbours.near,
        what="values",
        memory_of=("reel_exact_memory", *shape),
    )
    if wanted.kind == "b":
        if table.max() > 1:
            raise CorruptStreamError(f"truth values are 0 or 1; got {table.max()}")
        return table.view(np.bool_)
    return table


def _layout(table: Numbers) -> tuple[int, ...]:
    """Shape, bytes of a number and its kind, as the core takes them."""
    return (*table.shape, table.dtype.itemsize, "uif".index(table.dtype.kind))


def _checked(shape: tuple[int, ...], dtype: np.dtype[Any], neighbours: Neighbours) -> np.dtype[Any]:
    """The number type in the byte order of this machine."""
    if len(shape) != 3 or min(shape) < 0 or shape[0] > MOST_FRAMES:
        raise InvalidInputError(
            f"exact values must have shape (T, N, C), with at most {MOST_FRAMES} frames; "
            f"got {shape}"
        )
    if dtype.str[1:] not in TYPES:
        raise InvalidInputError(
            f"exact values must be of a type of {', '.join(TYPES)}; got {dtype}; convert them"
        )
    if len(neighbours.starts) != shape[1] + 1:
        raise InvalidInputError(
            f"neighbours must be those of the {shape[1]} items; "
            f"got {len(neighbours.starts) - 1} items"
        )
    return dtype.newbyteorder("=")
