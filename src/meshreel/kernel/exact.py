"""Lossless coding of numbers over time on a graph, by the core."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call, encoded
from meshreel.kernel.mesh import Neighbors

Numbers = npt.NDArray[Any]

TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "f4", "u8", "i8", "f8")
"""Number types in NumPy's notation; booleans are u1."""

MAX_FRAMES = 1 << 28
MAX_OVERHEAD_BYTES = 16
"""Maximum size of a block beyond that of its values."""


def encode_exact(values: Numbers, neighbors: Neighbors) -> bytes:
    """Encode a block of numbers over time without loss.

    Parameters
    ----------
    values : array of shape (T, N, C)
        Type from `TYPES`, or bool. Payloads of NaN and signs of zeros are preserved.
    neighbors : Neighbors
        Graph of the N items.

    Raises
    ------
    InvalidInputError
        If the shape, the number type or the neighbors do not fit.
    """
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    dtype = _checked_dtype(values.shape, values.dtype, neighbors)
    if values.size == 0:
        return b""
    table = np.array(values, dtype, order="C")  # a copy, because the core modifies it
    return encoded(
        "reel_exact_encode",
        table,
        *_layout(table),
        neighbors.starts,
        neighbors.near,
        noun="values",
        capacity=table.nbytes + MAX_OVERHEAD_BYTES,
        memory_of=("reel_exact_memory", *table.shape),
    )


def decode_exact(
    data: bytes, shape: tuple[int, int, int], dtype: npt.DTypeLike, neighbors: Neighbors
) -> Numbers:
    """Decode a block of shape (T, N, C) that `encode_exact` wrote; the caller must bound the shape.

    Raises
    ------
    CorruptStreamError
        If the bytes do not encode such a block.
    InvalidInputError
        If the shape, the number type or the neighbors do not fit.
    """
    target = np.dtype(dtype)
    stored_dtype = np.dtype(np.uint8) if target.kind == "b" else target
    table = np.zeros(shape, _checked_dtype(shape, stored_dtype, neighbors))
    if table.size == 0:
        if data:
            raise CorruptStreamError(f"a block without values has no bytes; got {len(data)}")
        return table.astype(target)
    call(
        "reel_exact_decode",
        data,
        table,
        *_layout(table),
        neighbors.starts,
        neighbors.near,
        noun="values",
        memory_of=("reel_exact_memory", *shape),
    )
    if target.kind == "b":
        if table.max() > 1:
            raise CorruptStreamError(f"booleans must be 0 or 1; got {table.max()}")
        return table.view(np.bool_)
    return table


def _layout(table: Numbers) -> tuple[int, ...]:
    """Shape, bytes per number and number kind, as arguments of the core."""
    return (*table.shape, table.dtype.itemsize, "uif".index(table.dtype.kind))


def _checked_dtype(
    shape: tuple[int, ...], dtype: np.dtype[Any], neighbors: Neighbors
) -> np.dtype[Any]:
    """Check the arguments; return the number type in native byte order."""
    if len(shape) != 3 or min(shape) < 0 or shape[0] > MAX_FRAMES:
        raise InvalidInputError(
            f"exact values must have shape (T, N, C), with at most {MAX_FRAMES} frames; got {shape}"
        )
    if dtype.str[1:] not in TYPES:
        raise InvalidInputError(
            f"exact values must have one of the types {', '.join(TYPES)}; got {dtype}; convert them"
        )
    if len(neighbors.starts) != shape[1] + 1:
        raise InvalidInputError(
            f"the values have {shape[1]} items; the neighbors have {len(neighbors.starts) - 1}"
        )
    return dtype.newbyteorder("=")
