"""Coder of rows of integers: tokens by asymmetric numeral systems, remaining bits raw."""

from collections.abc import Sequence

import constriction
import numpy as np
import numpy.typing as npt

from meshreel.entropy.bits import pack_bits, packed_size_bytes, unpack_bits
from meshreel.entropy.models import LEVEL_FREQUENCIES, read_tables, table_levels, write_tables
from meshreel.entropy.tokens import N_TOKENS, TOKEN_WIDTHS, join_integers, split_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError
from meshreel.runtime.profiling import staged

Integers = npt.NDArray[np.int64]

MAX_INTEGERS_PER_BYTE = 256
"""A reader refuses more integers a byte before it allocates; a writer pads with zero bytes."""


@staged("entropy coding")
def encode_integers(
    rows: Sequence[npt.NDArray[np.integer]], tables: Sequence[int] | None = None
) -> bytes:
    """Bytes of rows of integers, each row coded with a probability table of its own.

    Parameters
    ----------
    rows : sequence of integer arrays of shape (length,)
        Magnitudes up to 2^31 - 1. The reader needs the lengths.
    tables : sequence of int, optional
        Number of the table that each row uses, 0..n-1; rows that name the same share it.
        The reader needs them too. Default: row i uses table i.

    Raises
    ------
    InvalidInputError
        If an integer is too large.

    References
    ----------
    J. Duda, "Asymmetric numeral systems", arXiv:1311.2540.
    """
    table_of_row = _tables_of_rows(len(rows), tables)
    lengths = [len(row) for row in rows]
    flat = np.concatenate([np.asarray(row, np.int64) for row in rows]) if rows else _nothing()
    tokens, raw = split_integers(flat)
    pieces = np.split(tokens, np.cumsum(lengths)[:-1]) if rows else []
    counts = np.zeros((max(table_of_row, default=-1) + 1, N_TOKENS), np.int64)
    for piece, table in zip(pieces, table_of_row, strict=True):
        counts[table] += np.bincount(piece, minlength=N_TOKENS)
    levels = table_levels(counts)
    models = _models(levels)
    coder = constriction.stream.stack.AnsCoder()
    for piece, table in zip(reversed(pieces), reversed(table_of_row), strict=True):
        if models[table] is not None and len(piece):
            coder.encode_reverse(piece.astype(np.int32), models[table])
    words = coder.get_compressed().astype("<u4").tobytes()
    described = write_tables(levels)
    coded = b"".join(
        [
            write_varint(len(described)),
            described,
            write_varint(len(words) // 4),
            words,
            pack_bits(raw, TOKEN_WIDTHS[tokens]),
        ]
    )
    return coded.ljust(_least_size_bytes(lengths), b"\0")


@staged("entropy coding")
def decode_integers(
    data: bytes, lengths: Sequence[int], tables: Sequence[int] | None = None
) -> list[Integers]:
    """Rows that `encode_integers` wrote; the same lengths and tables must be given.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of rows of these lengths.
    """
    if len(data) < _least_size_bytes(lengths):
        raise CorruptStreamError(
            f"{len(data)} bytes cannot hold {sum(lengths)} integers; "
            f"at most {MAX_INTEGERS_PER_BYTE} a byte are allowed"
        )
    table_of_row = _tables_of_rows(len(lengths), tables)
    size, position = read_varint(data, 0)
    described, position = _take(data, position, size)
    levels = read_tables(described, max(table_of_row, default=-1) + 1)
    n_words, position = read_varint(data, position)
    words, position = _take(data, position, 4 * n_words)
    tokens = _decode_tokens(words, levels, lengths, table_of_row)
    widths = TOKEN_WIDTHS[tokens]
    end = position + packed_size_bytes(widths)
    if len(data) != max(end, _least_size_bytes(lengths)) or any(data[end:]):
        raise CorruptStreamError(
            f"the integers should end at byte {end} of their section; it has {len(data)} bytes"
        )
    values = join_integers(tokens, unpack_bits(data[position:end], widths))
    return np.split(values, np.cumsum(lengths)[:-1]) if lengths else []


def _decode_tokens(
    words: bytes, levels: Integers, lengths: Sequence[int], table_of_row: Sequence[int]
) -> Integers:
    try:
        coder = constriction.stream.stack.AnsCoder(np.frombuffer(words, "<u4").astype(np.uint32))
    except ValueError as error:
        raise CorruptStreamError(f"the coded tokens are damaged: {error}") from error
    models = _models(levels)
    tokens = np.empty(sum(lengths), np.int64)
    position = 0
    for length, table in zip(lengths, table_of_row, strict=True):
        model = models[table]
        here = tokens[position : position + length]
        if model is None:
            here[:] = np.argmax(levels[table] > 0)
        elif length:
            here[:] = coder.decode(model, length)
        position += length
    if not coder.is_empty():
        raise CorruptStreamError("coded tokens are left over")
    return tokens


def _models(levels: Integers) -> list[object | None]:
    """The model of each table; None where only one token (or none) can occur."""
    models: list[object | None] = []
    for row in levels:
        used = np.flatnonzero(row)
        if len(used) < 2:
            models.append(None)
            continue
        # Small exact integers as float64: sums and ratios below are the same on every machine.
        frequencies = LEVEL_FREQUENCIES[row[: used[-1] + 1]].astype(np.float64)
        models.append(constriction.stream.model.Categorical(frequencies, perfect=False))
    return models


def _tables_of_rows(n_rows: int, tables: Sequence[int] | None) -> list[int]:
    return list(range(n_rows)) if tables is None else list(tables)


def _least_size_bytes(lengths: Sequence[int]) -> int:
    return -(-sum(lengths) // MAX_INTEGERS_PER_BYTE)


def _take(data: bytes, position: int, size: int) -> tuple[bytes, int]:
    if size > len(data) - position:
        raise CorruptStreamError(f"{size} bytes are announced; {len(data) - position} are left")
    return data[position : position + size], position + size


def _nothing() -> Integers:
    return np.zeros(0, np.int64)
