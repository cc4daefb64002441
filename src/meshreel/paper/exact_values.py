"""Lossless coding of the positions of isolated vertices over time."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError
from meshreel.kernel.patterns import (
    decode_patterns,
    encode_patterns,
    linear_predictors,
    previous_predictors,
)

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
