"""Coder of fields: rows of integers over the same columns, each integer in its context.

Meant for small integers, many of them 0: residuals of modes at the vertices of a mesh, modes by
falling energy. Both sides adapt the statistics to what is already coded, so that no tables are
sent.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from meshreel.entropy.adaptive import BitPort, BitReader, BitWriter
from meshreel.entropy.bits import pack_bits, packed_size_bytes, unpack_bits
from meshreel.entropy.coder import MAX_INTEGERS_PER_BYTE
from meshreel.entropy.contexts import (
    MAX_EVIDENCE,
    MAX_MEAN_CLASS,
    UNIT,
    Contexts,
    Past,
    expected_classes,
    mean_class,
    mean_of_class,
    near_classes,
    past_classes,
)
from meshreel.entropy.passes import (
    Neighbourhood,
    Pass,
    in_coded_order,
    limited_signs,
    neighbourhoods,
    single_pass,
)
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.entropy.value_model import ValueModel, coarse, detail_widths
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.runtime.profiling import staged

Integers = npt.NDArray[np.int64]

N_ROWS_ALONE = 6
BATCH_ROWS = 6
FIRST_MEAN_CLASS = 2 * (UNIT.bit_length() - 1)  # the first rows are expected to have a mean of 1


@staged("entropy coding")
def encode_fields(fields: npt.NDArray[np.integer], passes: Sequence[Pass] | None = None) -> bytes:
    """Bytes of rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to 2^31 - 1. Rows that resemble those before take the fewest bytes.
    passes : sequence of Pass, optional
        The order in which each row is coded, and the context neighbours of each column. Columns of
        a pass should be alike in magnitude. The reader needs the same passes. Default: all columns
        at once.

    Raises
    ------
    InvalidInputError
        If an integer is too large, or the array does not have two axes.
    """
    values = np.asarray(fields, np.int64)
    largest = max(values.max(initial=0), -values.min(initial=0))
    if values.ndim != 2 or largest > MAX_MAGNITUDE:
        raise InvalidInputError(
            f"fields must have shape (rows, columns) and magnitudes up to {MAX_MAGNITUDE}; "
            f"got shape {values.shape}; use fewer bits or a larger quantisation step"
        )
    n_rows, n_columns = values.shape
    kept = coarse(values)
    port = BitWriter()
    _code_rows(port, kept, n_rows, n_columns, passes)
    words = port.words()
    widths = detail_widths(values)
    wide = widths > 0
    details = pack_bits(np.abs(values[wide] - kept[wide]), widths[wide])
    coded = write_varint(len(words) // 4) + words + details
    return coded.ljust(_least_size_bytes(n_rows, n_columns), b"\0")


@staged("entropy coding")
def decode_fields(
    data: bytes, n_rows: int, n_columns: int, passes: Sequence[Pass] | None = None
) -> Integers:
    """Integers of shape (rows, columns) that `encode_fields` wrote, given the same passes.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of such an array.
    """
    least = _least_size_bytes(n_rows, n_columns)
    if len(data) < least:
        raise CorruptStreamError(
            f"{len(data)} bytes cannot hold {n_rows} x {n_columns} integers; "
            f"at most one row and {MAX_INTEGERS_PER_BYTE} integers a byte are allowed"
        )
    n_words, start = read_varint(data, 0)
    if n_words > (len(data) - start) // 4:
        raise CorruptStreamError(f"{n_words} words are announced; {len(data) - start} bytes follow")
    position = start + 4 * n_words
    port = BitReader(data[start:position])
    kept = _code_rows(port, None, n_rows, n_columns, passes)
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
    passes: Sequence[Pass] | None,
) -> Integers:
    """Coarse integers of shape (rows, columns), written (those of `truth`) or read."""
    if not n_rows * n_columns:
        return np.zeros((n_rows, n_columns), np.int64)
    order, renumbered = in_coded_order(single_pass(n_columns) if passes is None else passes)
    plan = neighbourhoods(renumbered, n_columns)
    model, mean_model = ValueModel(), ValueModel()
    past = Past(n_columns)
    mean_classes = np.full(len(plan), FIRST_MEAN_CLASS)
    rows = np.empty((n_rows, n_columns), np.int64)
    for batch in _batches(n_rows):
        wanted = None if truth is None else truth[batch].take(order, axis=1).T
        mean_classes = _code_mean_classes(
            port, wanted, plan, mean_classes, batch.stop - batch.start, mean_model
        )
        rows[batch, order] = _code_batch(port, wanted, plan, past, mean_classes, model).T
        mean_classes = mean_classes[:, -1]
    return rows


def _batches(n_rows: int) -> list[slice]:
    """Rows that are coded together; the first ones alone, since later rows learn most from them."""
    alone = [slice(row, row + 1) for row in range(min(n_rows, N_ROWS_ALONE))]
    starts = range(N_ROWS_ALONE, n_rows, BATCH_ROWS)
    return alone + [slice(start, min(start + BATCH_ROWS, n_rows)) for start in starts]


def _code_mean_classes(
    port: BitPort,
    truth: Integers | None,
    plan: list[Neighbourhood],
    before: Integers,
    n_rows: int,
    model: ValueModel,
) -> Integers:
    """Classes of the mean magnitudes, or near them, of shape (passes, rows).

    The change from the row before the batch is coarse, as is all that the model codes: 5 becomes 4.
    It never turns a class above 0 into 0, which means that the pass is empty.
    """
    befores = np.repeat(before[:, None], n_rows, axis=1)
    changes = None
    if truth is not None:
        found = [[mean_class(row) for row in np.abs(truth[near.span].T)] for near in plan]
        changes = coarse(np.array(found) - befores).ravel()
    nothing = np.zeros(befores.size, np.int64)
    contexts = Contexts(np.full(befores.size, FIRST_MEAN_CLASS + 1), nothing, nothing, nothing)
    mean_classes = befores + model.code(port, changes, contexts).reshape(befores.shape)
    if mean_classes.min() < 0 or mean_classes.max() > MAX_MEAN_CLASS:
        raise CorruptStreamError(
            f"rows have mean classes {mean_classes.tolist()}; 0..{MAX_MEAN_CLASS} are allowed"
        )
    return np.asarray(mean_classes)


def _code_batch(
    port: BitPort,
    truth: Integers | None,
    plan: list[Neighbourhood],
    past: Past,
    mean_classes: Integers,
    model: ValueModel,
) -> Integers:
    """Values of a batch of rows, of shape (columns, rows); then the models learn from them."""
    n_columns, n_rows = len(past.means), mean_classes.shape[1]
    found, magnitudes, means, signed = np.zeros((4, n_columns, n_rows), np.int64)
    for place in np.flatnonzero(mean_classes.any(axis=1)):
        near, here = plan[place], plan[place].span
        means[here] = mean_of_class(mean_classes[place]) * (mean_classes[place] > 0)
        coded = np.flatnonzero(mean_classes[place])
        # All rows, as a rule: then nothing is copied.
        among = slice(None) if len(coded) == n_rows else coded
        values = None if truth is None else truth[here, among].ravel()
        contexts = _contexts(near, past, magnitudes[:, among], means[:, among], signed[:, among])
        found[here, among] = model.code(port, values, contexts).reshape(len(near.columns), -1)
        magnitudes[here] = np.minimum(np.abs(found[here]), MAX_EVIDENCE)
        signed[here] = limited_signs(found[here])
    for row in range(n_rows):
        past.add(magnitudes[:, row], means[:, row])
    signed = signed.astype(np.int8)  # small, since they are looked up often
    is_used = np.asarray(signed.any(axis=1))
    for near in plan:
        near.learn(signed, is_used)
    return found


def _contexts(
    around: Neighbourhood, past: Past, magnitudes: Integers, means: Integers, signed: Integers
) -> Contexts:
    """The contexts of the integers of a pass in some rows, column by column."""
    past_magnitudes = past.magnitudes[around.span, None]
    near, near_mean = around.sum_near(magnitudes), around.sum_near(means)
    expected = expected_classes(
        past_magnitudes,
        past.means[around.span, None],
        near,
        near_mean,
        means[around.span.start],
    )
    return Contexts(
        expected.ravel(),
        np.broadcast_to(past_classes(past_magnitudes), near.shape).ravel(),
        near_classes(near).ravel(),
        around.predict_signs(signed).ravel(),
    )


def _least_size_bytes(n_rows: int, n_columns: int) -> int:
    """Smallest payload a reader accepts; it bounds the reader's time and memory."""
    return max(n_rows, -(-n_rows * n_columns // MAX_INTEGERS_PER_BYTE))
