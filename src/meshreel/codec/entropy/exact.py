"""Lossless coding of numbers over time by their bit patterns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError
from meshreel.kernel.patterns import Expected, decode_patterns, encode_patterns


def nothing_expected(n_rows: int) -> Expected:
    """Rows in order, without predictions."""
    return Expected(_in_order(n_rows), np.zeros(n_rows + 1, np.int64), np.zeros((0, 3), np.int32))


def row_before_expected(n_rows: int) -> Expected:
    """Rows in order, each predicted to equal the previous one."""
    before = np.arange(max(n_rows - 1, 0), dtype=np.int32)
    triples = np.stack([before, before, np.full_like(before, -1)], axis=1)
    starts = np.maximum(np.arange(-1, n_rows, dtype=np.int64), 0)
    return Expected(_in_order(n_rows), starts, triples)


def same_step_expected(n_rows: int) -> Expected:
    """Rows in order, each predicted linearly from the previous two; the second equals the first."""
    expected = row_before_expected(n_rows)
    expected.triples[1:, 2] = expected.triples[:-1, 0]
    return expected


def _in_order(n_rows: int) -> npt.NDArray[np.int32]:
    return np.arange(n_rows, dtype=np.int32)


EXPECTATIONS = (row_before_expected, same_step_expected)
"""Predictions of a frame, by the first byte: the previous frame, or the previous motion."""


def encode_exact(values: npt.NDArray[Any]) -> bytes:
    """Encode values of shape (T, ...) of uint8, int32, float32 or float64 losslessly."""
    table = values.reshape(len(values), -1)
    coded = (
        bytes([code]) + encode_patterns(table, expected(len(table)))
        for code, expected in enumerate(EXPECTATIONS)
    )
    return min(coded, key=len)


def decode_exact(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Decode the values that `encode_exact` wrote; the caller bounds their number.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an array of this shape and type.
    """
    if not data or data[0] >= len(EXPECTATIONS):
        raise CorruptStreamError("the prediction of exact values is unknown")
    if len(data) > 1 and not data[-1]:
        raise CorruptStreamError("the numbers end before their section does")
    n_rows = shape[0]
    width = int(np.prod(shape[1:], dtype=object))
    expected = EXPECTATIONS[data[0]](n_rows)
    return decode_patterns(data[1:], (n_rows, width), np.dtype(dtype), expected).reshape(shape)
