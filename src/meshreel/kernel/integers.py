"""Rows of integers to bytes and back, by the core."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel.library import call, memory, size_of

MAX_MAGNITUDE = (1 << 31) - 1
BYTES_EACH = 16
"""Most bytes that an integer takes, and the end of the stream too."""


def encode_rows(rows: Sequence[npt.NDArray[np.integer]], tables: Sequence[int]) -> bytes:
    """Bytes of rows of integers, whose probabilities are learned while they are coded.

    Parameters
    ----------
    rows : sequence of integer arrays of shape (length,)
        Magnitudes up to `MAX_MAGNITUDE`, which the caller checks.
    tables : sequence of int
        Number of the table of probabilities that each row uses, 0, 1, ...
    """
    lengths = np.array([len(row) for row in rows], np.int64)
    values = np.concatenate([np.zeros(0, np.int32), *(np.asarray(row) for row in rows)])
    values = np.ascontiguousarray(values, np.int32)
    out = np.empty(BYTES_EACH * (len(values) + 1), np.uint8)
    n_tables, room = max(tables, default=-1) + 1, _memory(tables)
    size = call(
        "reel_integers_encode",
        room,
        len(room),
        values,
        lengths,
        np.array(tables, np.int32),
        len(rows),
        n_tables,
        out,
        len(out),
        what="integers",
    )
    return out[:size].tobytes()


def decode_rows(data: bytes, lengths: Sequence[int], tables: Sequence[int]) -> list[Integers]:
    """Rows that `encode_rows` wrote; the caller bounds the lengths.

    Raises
    ------
    CorruptStreamError
        If bytes are left over.
    """
    values = np.empty(sum(lengths), np.int32)
    n_tables, room = max(tables, default=-1) + 1, _memory(tables)
    call(
        "reel_integers_decode",
        room,
        len(room),
        data,
        len(data),
        np.array(lengths, np.int64),
        np.array(tables, np.int32),
        len(lengths),
        n_tables,
        values,
        what="integers",
    )
    found = values.astype(np.int64)
    return np.split(found, np.cumsum(lengths)[:-1]) if len(lengths) else []


def _memory(tables: Sequence[int]) -> npt.NDArray[np.uint8]:
    return memory(size_of("reel_integers_memory", max(tables, default=-1) + 1))
