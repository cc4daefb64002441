"""Lossless coder of numbers: differences of their bit patterns, deflated."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.deflate import deflate, inflate


def encode_exact(values: npt.NDArray[Any]) -> bytes:
    """Bytes of values of shape (T, ...) of 1, 4 or 8 bytes each, exactly.

    The bit patterns are differenced along the first axis and split into byte planes, so that
    values that are constant in time take almost no bytes.
    """
    patterns = np.ascontiguousarray(values).view(_pattern_type(values.dtype))
    differences = patterns.copy()
    differences[1:] -= patterns[:-1]
    planes = differences.astype(differences.dtype.newbyteorder("<")).view(np.uint8)
    planes = planes.reshape(-1, values.dtype.itemsize)
    return deflate(np.ascontiguousarray(planes.T).tobytes())


def decode_exact(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Values that `encode_exact` wrote; the caller bounds the shape.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an array of this shape and type.
    """
    dtype = np.dtype(dtype)
    pattern = _pattern_type(dtype)
    size_bytes = int(np.prod(shape)) * dtype.itemsize
    raw = inflate(data, size_bytes, "exact values")
    planes = np.frombuffer(raw, np.uint8).reshape(dtype.itemsize, -1)
    differences = np.ascontiguousarray(planes.T).view(pattern.newbyteorder("<")).reshape(shape)
    return np.cumsum(differences.astype(pattern), axis=0, dtype=pattern).view(dtype)


def _pattern_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype(f"u{dtype.itemsize}")
