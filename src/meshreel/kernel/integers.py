"""Coding of rows of integers with adaptive contexts of preceding integers, by the core."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call, encoded, int32s

MAX_MAGNITUDE = (1 << 31) - 1
MAX_INTEGER_BYTES = 16
"""Upper bound of the bytes of an integer, and of the end of a payload."""

MAX_TABLES = 64
"""Maximum number of probability tables of a payload; each takes 20 kB of memory."""


def encode_integers(
    rows: Sequence[npt.NDArray[np.integer]], tables: Sequence[int] | None = None
) -> bytes:
    """Encode rows of integers with probabilities that adapt from row to row.

    Parameters
    ----------
    rows : sequence of integer arrays of shape (length,)
        Magnitudes up to `MAX_MAGNITUDE`. The decoder needs the lengths.
    tables : sequence of int, optional
        Index of the probability table of each row, 0..63; rows with the same table share its
        statistics. The decoder needs the same tables. Default: row i uses table i.

    Raises
    ------
    InvalidInputError
        If an integer is too large.
    """
    for row in rows:
        largest = max(-int(row.min()), int(row.max())) if len(row) else 0
        if largest > MAX_MAGNITUDE:
            raise InvalidInputError(
                f"integers up to {MAX_MAGNITUDE} can be coded; got {largest}; "
                "use fewer bits or a larger quantization step"
            )
    tables = _tables_of_rows(len(rows), tables)
    lengths = np.array([len(row) for row in rows], np.int64)
    values = np.concatenate([np.zeros(0, np.int32), *(np.asarray(row) for row in rows)])
    values = int32s(values)
    n_tables = max(tables, default=-1) + 1
    return encoded(
        "reel_integers_encode",
        values,
        lengths,
        np.array(tables, np.int32),
        len(rows),
        n_tables,
        noun="integers",
        capacity=MAX_INTEGER_BYTES * (len(values) + 1),
        memory_of=("reel_integers_memory", n_tables),
    )


def decode_integers(
    data: bytes, lengths: Sequence[int], tables: Sequence[int] | None = None
) -> list[Integers]:
    """Decode rows that `encode_integers` wrote with these lengths and tables.

    The caller must bound the lengths: any number of zeros takes few bytes.

    Raises
    ------
    CorruptStreamError
        If the bytes do not encode rows of these lengths.
    """
    if data and not data[-1]:
        raise CorruptStreamError("the integers end before their section does")
    tables = _tables_of_rows(len(lengths), tables)
    values = np.empty(sum(lengths), np.int32)
    n_tables = max(tables, default=-1) + 1
    call(
        "reel_integers_decode",
        data,
        np.array(lengths, np.int64),
        np.array(tables, np.int32),
        len(lengths),
        n_tables,
        values,
        noun="integers",
        memory_of=("reel_integers_memory", n_tables),
    )
    if not lengths:
        return []
    return np.split(values.astype(np.int64), np.cumsum(lengths)[:-1])


def _tables_of_rows(n_rows: int, tables: Sequence[int] | None) -> Sequence[int]:
    indices = range(n_rows) if tables is None else tables
    if len(indices) != n_rows or max(indices, default=0) >= MAX_TABLES:
        raise ValueError(f"{n_rows} rows need as many table indices in 0..{MAX_TABLES - 1}")
    return indices
