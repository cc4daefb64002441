"""Coder of rows of integers: adaptive bits, in contexts of what stands before in the row."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.integers import MAX_MAGNITUDE, decode_rows, encode_rows
from meshreel.runtime.profiling import staged

MAX_TABLES = 64
"""Most tables of rows that are coded together; each takes 20 kB while it is in use."""


@staged("entropy coding")
def encode_integers(
    rows: Sequence[npt.NDArray[np.integer]], tables: Sequence[int] | None = None
) -> bytes:
    """Bytes of rows of integers, coded with probabilities that are learned from row to row.

    Parameters
    ----------
    rows : sequence of integer arrays of shape (length,)
        Magnitudes up to 2^31 - 1. The reader needs the lengths.
    tables : sequence of int, optional
        Number of the table that each row uses, 0..63; rows that name the same learn from each
        other. The reader needs them too. Default: row i uses table i.

    Raises
    ------
    InvalidInputError
        If an integer is too large.
    """
    _require_codable(rows)
    return encode_rows(rows, _tables_of_rows(len(rows), tables))


@staged("entropy coding")
def decode_integers(
    data: bytes, lengths: Sequence[int], tables: Sequence[int] | None = None
) -> list[Integers]:
    """Rows that `encode_integers` wrote; the same lengths and tables must be given.

    The caller bounds the lengths: any number of zeros takes few bytes.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of rows of these lengths.
    """
    if data and not data[-1]:
        raise CorruptStreamError("the integers end before their section does")
    return decode_rows(data, lengths, _tables_of_rows(len(lengths), tables))


def _require_codable(rows: Sequence[npt.NDArray[np.integer]]) -> None:
    for row in rows:
        if len(row) and max(-int(row.min()), int(row.max())) > MAX_MAGNITUDE:
            largest = max(-int(row.min()), int(row.max()))
            raise InvalidInputError(
                f"integers up to {MAX_MAGNITUDE} can be coded; got {largest}; "
                "use fewer bits or a larger quantisation step"
            )


def _tables_of_rows(n_rows: int, tables: Sequence[int] | None) -> Sequence[int]:
    found = range(n_rows) if tables is None else tables
    if len(found) != n_rows or max(found, default=0) >= MAX_TABLES:
        raise ValueError(f"{n_rows} rows need as many tables, of 0..{MAX_TABLES - 1}")
    return found
