"""Rows of integers over the same columns to bytes and back, each integer in its context.

Made for fields of small integers, many of them 0: coefficients of modes at the vertices of a
mesh, in modes of falling energy. Both sides learn the statistics from what is already coded, so
that no tables are sent.
"""

import numpy as np
import numpy.typing as npt

from meshreel.entropy.adaptive import BitPort, BitReader, BitWriter
from meshreel.entropy.bits import pack_bits, packed_size_bytes, unpack_bits
from meshreel.entropy.coder import MAX_INTEGERS_PER_BYTE
from meshreel.entropy.contexts import (
    MAX_EVIDENCE,
    MAX_SCALE,
    UNIT,
    Contexts,
    Past,
    expected_classes,
    mean_of_scale,
    near_classes,
    past_classes,
    scale_of_row,
)
from meshreel.entropy.passes import Neighbours, Pass, plan_passes, signed_votes
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.entropy.value_model import ValueModel, coarse, detail_widths
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, InvalidInputError

Integers = npt.NDArray[np.int64]

FIRST_SCALE = 2 * (UNIT.bit_length() - 1)  # the first row is expected to have a mean of 1
_ZERO = np.zeros(1, np.int64)
_SCALE_CHANGE = Contexts(np.array([FIRST_SCALE + 1]), _ZERO, _ZERO, _ZERO)


def encode_fields(fields: npt.NDArray[np.integer], neighbours: Neighbours | None) -> bytes:
    """Bytes that hold rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to 2^31 - 1. Rows that resemble those before cost least.
    neighbours : pair of integer arrays (indptr, indices), or None
        Neighbours of column i are indices[indptr[i] : indptr[i + 1]], all in 0..columns-1;
        integers of neighbours have similar magnitudes. The reader has to know them too.

    Raises
    ------
    InvalidInputError
        If an integer is too large, or the array has not two axes.
    """
    values = np.asarray(fields, np.int64)
    if values.ndim != 2 or np.any((values > MAX_MAGNITUDE) | (values < -MAX_MAGNITUDE)):
        raise InvalidInputError(
            f"fields must have shape (rows, columns) and magnitudes up to {MAX_MAGNITUDE}; "
            f"got shape {values.shape}; use fewer bits or a larger step"
        )
    n_rows, n_columns = values.shape
    kept = coarse(values)
    port = BitWriter()
    _code_rows(port, kept, n_rows, n_columns, neighbours)
    words = port.words()
    widths = detail_widths(values)
    wide = widths > 0
    details = pack_bits(np.abs(values - kept)[wide], widths[wide])
    coded = write_varint(len(words) // 4) + words + details
    return coded.ljust(_least_size_bytes(n_rows, n_columns), b"\0")


def decode_fields(
    data: bytes, n_rows: int, n_columns: int, neighbours: Neighbours | None
) -> Integers:
    """Integers of shape (rows, columns) that `encode_fields` wrote; neighbours as given there.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of such an array.
    """
    least = _least_size_bytes(n_rows, n_columns)
    if len(data) < least:
        raise CorruptStreamError(
            f"{len(data)} bytes cannot hold {n_rows} x {n_columns} integers; "
            f"at most a row and {MAX_INTEGERS_PER_BYTE} integers a byte are allowed"
        )
    n_words, start = read_varint(data, 0)
    if n_words > (len(data) - start) // 4:
        raise CorruptStreamError(f"{n_words} words are announced; {len(data) - start} bytes follow")
    position = start + 4 * n_words
    port = BitReader(data[start:position])
    kept = _code_rows(port, None, n_rows, n_columns, neighbours)
    port.finish()
    widths = detail_widths(kept)
    wide = widths > 0
    end = position + packed_size_bytes(widths[wide])
    if len(data) != max(end, least) or any(data[end:]):
        raise CorruptStreamError(
            f"the fields should end at byte {end} of their section; it has {len(data)} bytes"
        )
    details = unpack_bits(data[position:end], widths[wide])
    kept[wide] += np.where(kept[wide] < 0, -details, details)
    return kept


def _code_rows(
    port: BitPort,
    truth: Integers | None,
    n_rows: int,
    n_columns: int,
    neighbours: Neighbours | None,
) -> Integers:
    """Coarse integers of shape (rows, columns), written (those of `truth`) or read."""
    rows = np.zeros((n_rows, n_columns), np.int64)
    if not rows.size:
        return rows
    passes = plan_passes(n_columns, neighbours)
    model, scale_model = ValueModel(), ValueModel()
    past = Past(n_columns)
    scale = FIRST_SCALE
    for number in range(n_rows):
        row = None if truth is None else truth[number]
        scale = _code_scale(port, row, scale, scale_model)
        if scale:
            mean = int(mean_of_scale(np.array(scale, np.int64)))
            rows[number] = _code_row(port, row, mean, past, passes, model)
    return rows


def _code_scale(port: BitPort, row: Integers | None, before: int, model: ValueModel) -> int:
    """Class of the mean magnitude of a row, or of one between it and the class before.

    The change is coarse, as all that the model codes: a leap of 5 arrives as 4. It never turns
    a class above 0 into 0, which says that the row is empty.
    """
    change = None if row is None else coarse(np.array([scale_of_row(np.abs(row)) - before]))
    scale = before + int(model.code(port, change, _SCALE_CHANGE)[0])
    if not 0 <= scale <= MAX_SCALE:
        raise CorruptStreamError(f"a row has a scale of {scale}; 0..{MAX_SCALE} are allowed")
    return scale


def _code_row(
    port: BitPort,
    truth: Integers | None,
    mean: int,
    past: Past,
    passes: list[Pass],
    model: ValueModel,
) -> Integers:
    row = np.zeros_like(past.columns)
    magnitudes = np.zeros_like(row)
    for step in passes:
        columns = step.columns
        near, before = step.magnitudes_near(magnitudes), past.columns[columns]
        contexts = Contexts(
            expected_classes(before, past.mean, near, step.n_near, mean),
            past_classes(before),
            near_classes(near),
            step.predict_signs(signed_votes(row)),
        )
        row[columns] = model.code(port, None if truth is None else truth[columns], contexts)
        magnitudes[columns] = np.minimum(np.abs(row[columns]), MAX_EVIDENCE)
    past.add(magnitudes, mean)
    for step in passes:
        step.learn(signed_votes(row))
    return row


def _least_size_bytes(n_rows: int, n_columns: int) -> int:
    """Smallest payload a reader accepts; it bounds the reader's time and memory."""
    return max(n_rows, -(-n_rows * n_columns // MAX_INTEGERS_PER_BYTE))
