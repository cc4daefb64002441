"""Rows of integers over the same columns to bytes and back, each integer in its context.

Made for fields of small integers, many of them 0: coefficients of modes at the vertices of a
mesh, in modes of falling energy. Both sides learn the statistics from what is already coded, so
that no tables are sent.
"""

import threading
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from meshreel.entropy.adaptive import BitPort, BitReader, BitWriter
from meshreel.entropy.bits import pack_bits, unpack_bits
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
    scale_of_mean,
)
from meshreel.entropy.passes import (
    Neighbourhood,
    Pass,
    in_coded_order,
    neighbourhoods,
    signed_votes,
    single_pass,
)
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.entropy.value_model import ValueModel, coarse, detail_widths
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.profiling import staged
from meshreel.threads import in_background

Integers = npt.NDArray[np.int64]

N_ROWS_ALONE = 6
BATCH_ROWS = 6
FIRST_SCALE = 2 * (UNIT.bit_length() - 1)  # first rows are expected to have a mean of 1


@staged("entropy coding")
def encode_fields(fields: npt.NDArray[np.integer], passes: Sequence[Pass] | None = None) -> bytes:
    """Bytes that hold rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to 2^31 - 1. Rows that resemble those before cost least.
    passes : sequence of Pass, optional
        In which order each row is coded, and which columns have similar magnitudes. Columns of a
        pass should have a mean magnitude of their own. The reader has to know them too. Default:
        all columns at once.

    Raises
    ------
    InvalidInputError
        If an integer is too large, or the array has not two axes.
    """
    values = np.asarray(fields, np.int64)
    largest = max(values.max(initial=0), -values.min(initial=0))
    if values.ndim != 2 or largest > MAX_MAGNITUDE:
        raise InvalidInputError(
            f"fields must have shape (rows, columns) and magnitudes up to {MAX_MAGNITUDE}; "
            f"got shape {values.shape}; use fewer bits or a larger step"
        )
    n_rows, n_columns = values.shape
    kept = coarse(values)
    port = BitWriter()
    for _ in _code_rows(port, kept, n_rows, n_columns, passes):
        pass  # the port has all that is coded
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
    """Integers of shape (rows, columns) that `encode_fields` wrote; passes as given there.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of such an array.
    """
    rows = _room_for(data, n_rows, n_columns)
    for batch, values in _decoded_rows(data, n_rows, n_columns, passes):
        rows[batch] = values
    return rows


class IncomingFields:
    """What `decode_fields` gives, decoded in the background: rows can be had while others come.

    Whoever takes the last rows, or any after an error, gets the error that `decode_fields` raises.
    """

    def __init__(
        self, data: bytes, n_rows: int, n_columns: int, passes: Sequence[Pass] | None = None
    ) -> None:
        self._rows = _room_for(data, n_rows, n_columns)
        self._n_there = 0
        self._arrival = threading.Condition()
        self._end = in_background(lambda: self._take_in(_decoded_rows(data, *self.shape, passes)))

    @property
    def shape(self) -> tuple[int, int]:
        """How many rows and columns there will be."""
        return self._rows.shape

    def __getitem__(self, rows: slice) -> Integers:
        """Some rows; it waits for them."""
        _, stop, _ = rows.indices(len(self._rows))
        with self._arrival:
            self._arrival.wait_for(lambda: self._n_there >= stop)
        if self._n_there == len(self._rows):
            self._end.result()
        return self._rows[rows]

    def _take_in(self, batches: Iterator[tuple[slice, Integers]]) -> None:
        try:
            for batch, values in batches:
                self._rows[batch] = values
                self._announce(batch.stop)
        finally:
            self._announce(len(self._rows))  # nothing more will come, as after an error

    def _announce(self, n_there: int) -> None:
        with self._arrival:
            self._n_there = n_there
            self._arrival.notify_all()


def _room_for(data: bytes, n_rows: int, n_columns: int) -> Integers:
    """An array for the integers, if the bytes can hold so many."""
    if len(data) < _least_size_bytes(n_rows, n_columns):
        raise CorruptStreamError(
            f"{len(data)} bytes cannot hold {n_rows} x {n_columns} integers; "
            f"at most a row and {MAX_INTEGERS_PER_BYTE} integers a byte are allowed"
        )
    return np.empty((n_rows, n_columns), np.int64)


def _decoded_rows(
    data: bytes, n_rows: int, n_columns: int, passes: Sequence[Pass] | None
) -> Iterator[tuple[slice, Integers]]:
    """Batches of rows, and their integers; all bytes are checked when it comes to its end."""
    n_words, start = read_varint(data, 0)
    if n_words > (len(data) - start) // 4:
        raise CorruptStreamError(f"{n_words} words are announced; {len(data) - start} bytes follow")
    position = start + 4 * n_words
    port, details, n_bits = BitReader(data[start:position]), data[position:], 0
    for batch, values in _code_rows(port, None, n_rows, n_columns, passes):
        n_bits += _add_details(values, details, n_bits)
        yield batch, values
    port.finish()
    end = position + (n_bits + 7) // 8
    if len(data) != max(end, _least_size_bytes(n_rows, n_columns)) or any(data[end:]):
        raise CorruptStreamError(
            f"the fields should end at byte {end} of their section; it has {len(data)} bytes"
        )


def _add_details(values: Integers, details: bytes, first_bit: int) -> int:
    """Make coarse values exact, in place; how many bits that took."""
    widths = detail_widths(values)
    wide = widths > 0
    n_bits = int(widths.sum())
    if first_bit + n_bits > 8 * len(details):
        raise CorruptStreamError(f"{len(details)} bytes cannot hold the details of the fields")
    raw = unpack_bits(details, widths[wide], first_bit)
    values[wide] += np.where(values[wide] < 0, -raw, raw)
    return n_bits


def _code_rows(
    port: BitPort,
    truth: Integers | None,
    n_rows: int,
    n_columns: int,
    passes: Sequence[Pass] | None,
) -> Iterator[tuple[slice, Integers]]:
    """Batches of rows with their coarse integers, written (those of `truth`) or read."""
    if not n_columns:
        return
    order, steps = in_coded_order(single_pass(n_columns) if passes is None else passes)
    plan = neighbourhoods(steps, n_columns)
    model, scale_model = ValueModel(), ValueModel()
    past = Past(n_columns)
    scales = np.full(len(plan), FIRST_SCALE)
    for batch in _batches(n_rows):
        wanted = None if truth is None else truth[batch].take(order, axis=1).T
        scales = _code_scales(port, wanted, plan, scales, batch.stop - batch.start, scale_model)
        rows = np.empty((batch.stop - batch.start, n_columns), np.int64)
        rows[:, order] = _code_batch(port, wanted, plan, past, scales, model).T
        scales = scales[:, -1]
        yield batch, rows


def _batches(n_rows: int) -> list[slice]:
    """Rows that are coded together; the first ones alone, for they tell most of the others."""
    alone = [slice(row, row + 1) for row in range(min(n_rows, N_ROWS_ALONE))]
    starts = range(N_ROWS_ALONE, n_rows, BATCH_ROWS)
    return alone + [slice(start, min(start + BATCH_ROWS, n_rows)) for start in starts]


def _code_scales(
    port: BitPort,
    truth: Integers | None,
    plan: list[Neighbourhood],
    before: Integers,
    n_rows: int,
    model: ValueModel,
) -> Integers:
    """Classes of the mean magnitudes, or near them, of passes and rows: of that shape.

    The change to the row before the batch is coarse, as all that the model codes: a leap of 5
    arrives as 4. It never turns a class above 0 into 0, which says that the pass is empty.
    """
    befores = np.repeat(before[:, None], n_rows, axis=1)
    changes = None
    if truth is not None:
        found = [[scale_of_mean(row) for row in np.abs(truth[step.span].T)] for step in plan]
        changes = coarse(np.array(found) - befores).ravel()
    nothing = np.zeros(befores.size, np.int64)
    contexts = Contexts(np.full(befores.size, FIRST_SCALE + 1), nothing, nothing, nothing)
    scales = befores + model.code(port, changes, contexts).reshape(befores.shape)
    if scales.min() < 0 or scales.max() > MAX_SCALE:
        raise CorruptStreamError(f"rows have scales {scales.tolist()}; 0..{MAX_SCALE} are allowed")
    return np.asarray(scales)


def _code_batch(
    port: BitPort,
    truth: Integers | None,
    plan: list[Neighbourhood],
    past: Past,
    scales: Integers,
    model: ValueModel,
) -> Integers:
    """Rows, of shape (columns, rows), pass by pass; then it learns from them."""
    n_columns, n_rows = len(past.means), scales.shape[1]
    found, magnitudes, means, signed = np.zeros((4, n_columns, n_rows), np.int64)
    for place in np.flatnonzero(scales.any(axis=1)):
        step, here = plan[place], plan[place].span
        means[here] = mean_of_scale(scales[place]) * (scales[place] > 0)
        coded = np.flatnonzero(scales[place])
        # All rows, as a rule: then nothing is copied.
        among = slice(None) if len(coded) == n_rows else coded
        values = None if truth is None else truth[here, among].ravel()
        contexts = _contexts(step, past, magnitudes[:, among], means[:, among], signed[:, among])
        found[here, among] = model.code(port, values, contexts).reshape(len(step.columns), -1)
        magnitudes[here] = np.minimum(np.abs(found[here]), MAX_EVIDENCE)
        signed[here] = signed_votes(found[here])
    for row in range(n_rows):
        past.add(magnitudes[:, row], means[:, row])
    signed = signed.astype(np.int8)  # small, for they are looked up often
    votes = np.asarray(signed.any(axis=1))
    for step in plan:
        step.learn(signed, votes)
    return found


def _contexts(
    step: Neighbourhood, past: Past, magnitudes: Integers, means: Integers, signed: Integers
) -> Contexts:
    """What is known of the integers of a pass in some rows, column by column."""
    past_magnitudes = past.magnitudes[step.span, None]
    near, near_mean = step.sum_near(magnitudes), step.sum_near(means)
    expected = expected_classes(
        past_magnitudes,
        past.means[step.span, None],
        near,
        near_mean,
        means[step.span.start],
    )
    return Contexts(
        expected.ravel(),
        np.broadcast_to(past_classes(past_magnitudes), near.shape).ravel(),
        near_classes(near).ravel(),
        step.predict_signs(signed).ravel(),
    )


def _least_size_bytes(n_rows: int, n_columns: int) -> int:
    """Smallest payload a reader accepts; it bounds the reader's time and memory."""
    return max(n_rows, -(-n_rows * n_columns // MAX_INTEGERS_PER_BYTE))
