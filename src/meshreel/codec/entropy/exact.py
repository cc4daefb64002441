"""Lossless coding of numbers over time by their bit patterns."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError
from meshreel.kernel.patterns import Predictors, decode_patterns, encode_patterns


def no_predictors(n_rows: int) -> Predictors:
    """Rows in order, without predictions."""
    return Predictors(_in_order(n_rows), np.zeros(n_rows + 1, np.int64), np.zeros((0, 3), np.int32))


def previous_predictors(n_rows: int) -> Predictors:
    """Rows in order, each predicted to equal the previous one."""
    previous = np.arange(max(n_rows - 1, 0), dtype=np.int32)
    triples = np.stack([previous, previous, np.full_like(previous, -1)], axis=1)
    starts = np.maximum(np.arange(-1, n_rows, dtype=np.int64), 0)
    return Predictors(_in_order(n_rows), starts, triples)


def linear_predictors(n_rows: int) -> Predictors:
    """Rows in order, each predicted linearly from the previous two; the second, from the first."""
    predictors = previous_predictors(n_rows)
    predictors.triples[1:, 2] = predictors.triples[:-1, 0]
    return predictors


def _in_order(n_rows: int) -> npt.NDArray[np.int32]:
    return np.arange(n_rows, dtype=np.int32)


PREDICTORS = (previous_predictors, linear_predictors)
"""Predictors of a frame, by the first byte: the previous frame, or the previous two."""


def encode_exact(values: npt.NDArray[Any]) -> bytes:
    """Encode values of shape (T, ...) of uint8, int32, float32 or float64 losslessly."""
    table = values.reshape(len(values), -1)
    coded = (
        bytes([code]) + encode_patterns(table, predictors_of(len(table)))
        for code, predictors_of in enumerate(PREDICTORS)
    )
    return min(coded, key=len)


def decode_exact(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Decode the values that `encode_exact` wrote; the caller bounds their number.

    Raises
    ------
    CorruptStreamError
        If the bytes do not encode an array of this shape and type.
    """
    if not data or data[0] >= len(PREDICTORS):
        raise CorruptStreamError("the prediction of exact values is unknown")
    if len(data) > 1 and not data[-1]:
        raise CorruptStreamError("the numbers end before their section does")
    n_rows = shape[0]
    width = int(np.prod(shape[1:], dtype=object))
    predictors = PREDICTORS[data[0]](n_rows)
    return decode_patterns(data[1:], (n_rows, width), np.dtype(dtype), predictors).reshape(shape)
