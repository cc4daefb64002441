"""Lossless coder of tables of numbers: as multiples of a fraction, or as they are."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.entropy.exact import decode_numbers, encode_numbers, require_room
from meshreel.entropy.expected import nothing_expected, row_before_expected
from meshreel.entropy.multiples import CODES, GRID, as_multiples, values_of
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.kernel.patterns import Expected

Integers = npt.NDArray[np.integer]

AS_THEY_ARE = 255
"""First byte of a table of numbers that are not written as integers by another number."""

INTEGER = np.dtype(np.int32)


def encode_table(values: npt.NDArray[Any], expected: Sequence[Expected] = ()) -> bytes:
    """Bytes of a table of shape (N, C), exactly.

    Parameters
    ----------
    values : array of uint8, int32, float32 or float64
    expected : sequence of Expected, optional
        From which others rows may be expected, besides nothing and the row before. The reader
        needs the same.
    """
    forms = [(AS_THEY_ARE, values), *as_multiples(values)]
    return min((_encode(code, numbers, expected) for code, numbers in forms), key=len)


def encode_grid_table(integers: Integers, bits: int, expected: Sequence[Expected] = ()) -> bytes:
    """Bytes of a table of shape (N, C) of integer multiples of 2^-bits."""
    return _encode(GRID + bits, integers.astype(INTEGER), expected)


def decode_table(
    data: bytes,
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    expected: Sequence[Expected] = (),
) -> npt.NDArray[Any]:
    """The table that `encode_table` or `encode_grid_table` wrote.

    Nothing is allocated that the bytes cannot hold.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not those of a table of this shape and type.
    """
    if len(data) < 2:
        raise TruncatedStreamError("a table of values ends inside its first two bytes")
    (code, way), packed = data[:2], data[2:]
    require_room(packed, *shape)
    ways = _ways(shape[0], expected)
    if way >= len(ways):
        raise CorruptStreamError(f"rows are expected in way {way}, which is unknown")
    if code == AS_THEY_ARE:
        return decode_numbers(packed, shape, dtype, ways[way])
    if code not in CODES or dtype.kind != "f":
        raise CorruptStreamError(f"a table of {dtype} is written in form {code}, which is unknown")
    return values_of(decode_numbers(packed, shape, INTEGER, ways[way]), code, dtype)


def _encode(code: int, numbers: npt.NDArray[Any], expected: Sequence[Expected]) -> bytes:
    coded = (
        bytes([code, way]) + encode_numbers(numbers, rows)
        for way, rows in enumerate(_ways(len(numbers), expected))
    )
    return min(coded, key=len)


def _ways(n_rows: int, expected: Sequence[Expected]) -> list[Expected]:
    return [nothing_expected(n_rows), row_before_expected(n_rows), *expected]
