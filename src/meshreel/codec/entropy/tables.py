"""Lossless coder of tables of numbers: as multiples of a fraction, or as they are."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.entropy.exact import encode_numbers, nothing_expected, row_before_expected
from meshreel.codec.entropy.multiples import GRID, as_multiples
from meshreel.kernel.patterns import Expected

Integers = npt.NDArray[np.integer]
Numbers = npt.NDArray[Any]
Along = Callable[[int], Expected]
"""From which others each row is expected, given the number of rows."""

AS_THEY_ARE = 255
"""First byte of a table of numbers that are not written as integers by another number."""

INTEGER = np.dtype(np.int32)


def encode_table(values: Numbers, along: Along | None = None) -> bytes:
    """Bytes of a table of shape (N, C), exactly.

    Parameters
    ----------
    values : array of uint8, int32, float32 or float64
    along : callable, optional
        From which others rows may be expected, besides nothing and the row before. The reader
        needs the same.
    """
    return _shortest([(AS_THEY_ARE, values), *as_multiples(values)], along)


def encode_grid_table(integers: Integers, bits: int, along: Along | None = None) -> bytes:
    """Bytes of a table of shape (N, C) of integer multiples of 2^-bits."""
    return _shortest([(GRID + bits, integers.astype(INTEGER))], along)


def _shortest(forms: list[tuple[int, Numbers]], along: Along | None) -> bytes:
    """The shortest of all ways to write a table that has several forms."""
    return min(
        (
            bytes([code, way]) + encode_numbers(numbers, expected)
            for way, expected in enumerate(one(len(forms[0][1])) for one in _ways(along))
            for code, numbers in forms
        ),
        key=len,
    )


def _ways(along: Along | None) -> list[Along]:
    return [nothing_expected, row_before_expected, *([along] if along else [])]
