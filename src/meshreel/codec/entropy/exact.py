"""Lossless coder of numbers over time, from their bit patterns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.entropy.expected import row_before_expected, same_step_expected
from meshreel.errors import CorruptStreamError
from meshreel.kernel.patterns import Expected, decode_patterns, encode_patterns

EXPECTATIONS = (row_before_expected, same_step_expected)
"""What is expected of a frame, by the first byte: the frame before, or the same motion again."""


def encode_exact(values: npt.NDArray[Any]) -> bytes:
    """Bytes of values of shape (T, ...) of uint8, int32, float32 or float64, exactly."""
    table = values.reshape(len(values), -1)
    coded = (
        bytes([way]) + encode_numbers(table, expected(len(table)))
        for way, expected in enumerate(EXPECTATIONS)
    )
    return min(coded, key=len)


def decode_exact(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Values that `encode_exact` wrote; the caller bounds their number.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an array of this shape and type.
    """
    if not data or data[0] >= len(EXPECTATIONS):
        raise CorruptStreamError("it is not known how exact values follow one another")
    n_rows = shape[0]
    width = int(np.prod(shape[1:], dtype=object))
    expected = EXPECTATIONS[data[0]](n_rows)
    return decode_numbers(data[1:], (n_rows, width), np.dtype(dtype), expected).reshape(shape)


def encode_numbers(table: npt.NDArray[Any], expected: Expected) -> bytes:
    """Bytes of a table of shape (N, C)."""
    return encode_patterns(table, expected)


def decode_numbers(
    data: bytes, shape: tuple[int, int], dtype: np.dtype[Any], expected: Expected
) -> npt.NDArray[Any]:
    """The table that `encode_numbers` wrote; the caller bounds its shape.

    Raises
    ------
    CorruptStreamError
        If bytes are left over.
    """
    if data and not data[-1]:
        raise CorruptStreamError("the numbers end before their section does")
    return decode_patterns(data, shape, dtype, expected)
