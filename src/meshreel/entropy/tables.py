"""Lossless coder of tables of numbers: as multiples of a fraction, or as they are."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.exact import decode_numbers, encode_numbers
from meshreel.entropy.expected import nothing_expected, row_before_expected
from meshreel.entropy.multiples import CODES, GRID, as_multiples, values_of
from meshreel.errors import CorruptStreamError, TruncatedStreamError
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


def decode_table(
    data: bytes, shape: tuple[int, int], dtype: np.dtype[Any], along: Along | None = None
) -> Numbers:
    """The table that `encode_table` or `encode_grid_table` wrote.

    The caller bounds the shape.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not those of a table of this shape and type.
    """
    if len(data) < 2:
        raise TruncatedStreamError("a table of values ends inside its first two bytes")
    (code, way), packed = data[:2], data[2:]
    ways = _ways(along)
    if way >= len(ways):
        raise CorruptStreamError(f"rows are expected in way {way}, which is unknown")
    if code != AS_THEY_ARE and (code not in CODES or dtype.kind != "f"):
        raise CorruptStreamError(f"a table of {dtype} is written in form {code}, which is unknown")
    expected = ways[way](shape[0])
    if code == AS_THEY_ARE:
        return decode_numbers(packed, shape, dtype, expected)
    return values_of(decode_numbers(packed, shape, INTEGER, expected), code, dtype)


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
