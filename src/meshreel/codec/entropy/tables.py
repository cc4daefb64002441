"""Lossless coding of tables of numbers, as multiples of a fraction or by their bit patterns."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.entropy.exact import encode_numbers, nothing_expected, row_before_expected
from meshreel.codec.entropy.multiples import GRID, as_multiples
from meshreel.kernel.patterns import Expected

Integers = npt.NDArray[np.integer]
Numbers = npt.NDArray[Any]
RowPredictor = Callable[[int], Expected]
"""Returns the rows that each row is predicted from, for a number of rows."""

BIT_PATTERNS = 255
"""First byte of a table that is not stored as multiples."""

INTEGER = np.dtype(np.int32)


def encode_table(values: Numbers, predictor: RowPredictor | None = None) -> bytes:
    """Encode a table of shape (N, C) losslessly.

    Parameters
    ----------
    values : array of uint8, int32, float32 or float64
    predictor : callable, optional
        A further prediction to try, besides none and the previous row. The reader needs the same.
    """
    return _shortest([(BIT_PATTERNS, values), *as_multiples(values)], predictor)


def encode_grid_table(
    integers: Integers, bits: int, predictor: RowPredictor | None = None
) -> bytes:
    """Encode a table of shape (N, C) of integer multiples of 2^-bits."""
    return _shortest([(GRID + bits, integers.astype(INTEGER))], predictor)


def _shortest(forms: list[tuple[int, Numbers]], predictor: RowPredictor | None) -> bytes:
    """Encode a table by the form and prediction that take the fewest bytes."""
    predictors = [nothing_expected, row_before_expected, *([predictor] if predictor else [])]
    n_rows = len(forms[0][1])
    return min(
        (
            bytes([code, number]) + encode_numbers(numbers, expected)
            for number, expected in enumerate(one(n_rows) for one in predictors)
            for code, numbers in forms
        ),
        key=len,
    )
