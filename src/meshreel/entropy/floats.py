"""Floats to bytes and back without loss: differences of their bit patterns in time, deflated."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.deflate import deflate, inflate


def encode_floats(values: npt.NDArray[np.floating]) -> bytes:
    """Bytes that hold float32 or float64 values of shape (T, ...), exactly.

    The bit patterns are differenced along the first axis and split into byte planes, so that
    what stands still in time costs next to nothing.
    """
    patterns = np.ascontiguousarray(values).view(_pattern_type(values.dtype))
    steps = patterns.copy()
    steps[1:] -= patterns[:-1]
    planes = steps.astype(steps.dtype.newbyteorder("<")).view(np.uint8)
    planes = planes.reshape(-1, values.dtype.itemsize)
    return deflate(np.ascontiguousarray(planes.T).tobytes())


def decode_floats(
    data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike
) -> npt.NDArray[np.floating]:
    """Values that `encode_floats` wrote; the caller bounds the shape.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an array of this shape and type.
    """
    dtype = np.dtype(dtype)
    pattern = _pattern_type(dtype)
    size_bytes = int(np.prod(shape)) * dtype.itemsize
    raw = inflate(data, size_bytes, "exact positions")
    planes = np.frombuffer(raw, np.uint8).reshape(dtype.itemsize, -1)
    steps = np.ascontiguousarray(planes.T).view(pattern.newbyteorder("<")).reshape(shape)
    return np.cumsum(steps.astype(pattern), axis=0, dtype=pattern).view(dtype)


def _pattern_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    return np.dtype(np.uint32 if dtype.itemsize == 4 else np.uint64)
