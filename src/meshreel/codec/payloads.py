"""Integers to the payloads of sections and back: the layouts of `docs/format.md`."""

import struct
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from meshreel.codec.pipeline import Quantized
from meshreel.codec.reel import Layout
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.field_coder import decode_fields, encode_fields
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from meshreel.quantization.uniform import Steps

Integers = npt.NDArray[np.int64]

MAX_DIFFERENCE = 2

FIELDS_LAYOUT = 2
"""Layout of the sections of `reel`; to be raised with every change until the method is settled."""

MAX_COUNTS = 32
"""Most groups of modes and most stages of anchors: each costs a factorisation."""

MAX_SPACING = 64
"""Largest spacing of anchors, in edges."""


def write_anchor_vertices(anchors: Integers) -> bytes:
    """Ascending vertex numbers: their count and their differences."""
    return write_varint(len(anchors)) + encode_integers([np.diff(anchors, prepend=0)])


def read_anchor_vertices(payload: bytes, n_verts: int) -> Integers:
    """Undo `write_anchor_vertices`.

    Raises
    ------
    CorruptStreamError
        If they are not ascending vertex numbers.
    """
    n_anchors, position = read_varint(payload, 0)
    if n_anchors > n_verts:
        raise CorruptStreamError(f"{n_anchors} anchors are announced for {n_verts} vertices")
    (steps,) = decode_integers(payload[position:], [n_anchors])
    anchors = np.cumsum(steps)
    if np.any(steps[1:] < 1) or np.any(anchors < 0) or np.any(anchors >= n_verts):
        raise CorruptStreamError("the anchors are not ascending vertex numbers")
    return anchors


def write_block(n_frames: int, n_modes: int) -> bytes:
    """Numbers of frames and modes of a block."""
    return write_varint(n_frames) + write_varint(n_modes)


def read_block(payload: bytes) -> tuple[int, int]:
    """Undo `write_block`.

    Raises
    ------
    CorruptStreamError
        If a number is 0, or bytes are left over.
    """
    n_frames, position = read_varint(payload, 0)
    n_modes, position = read_varint(payload, position)
    if not (n_modes and n_frames) or position != len(payload):
        raise CorruptStreamError(
            f"a block announces {n_frames} frames and {n_modes} modes; each must be at least 1"
        )
    return n_frames, n_modes


def write_curves(curves: Quantized) -> bytes:
    """Rows over time: for each the difference that makes it smallest, and which one that is."""
    n_rows, n_frames = curves.integers.shape[1:]
    differenced = [_best_difference(row) for row in curves.integers.reshape(-1, n_frames)]
    orders = np.array([order for order, _ in differenced], np.int64)
    rows = [orders, *(row for _, row in differenced)]
    return _write_steps(curves.steps) + encode_integers(rows, [0, *_shared_tables(n_rows, 1)])


def read_curves(payload: bytes, n_rows: int, n_frames: int) -> Quantized:
    """Undo `write_curves`: integers of shape (3, rows, T)."""
    steps, coded = _read_steps(payload, n_rows)
    lengths = [3 * n_rows, *[n_frames] * (3 * n_rows)]
    orders, *rows = decode_integers(coded, lengths, [0, *_shared_tables(n_rows, 1)])
    _check_orders(orders)
    summed = np.empty((3 * n_rows, n_frames), np.int64)
    for target, order, row in zip(summed, orders, rows, strict=True):
        target[:] = _sum_up(row, int(order))
    return Quantized(summed.reshape(3, n_rows, n_frames), steps)


def write_rows(rows: Quantized, *, shared: bool) -> bytes:
    """Rows of coefficients, each with a table of its own or shared by modes of similar number."""
    n_rows, length = rows.integers.shape[1:]
    tables = _shared_tables(n_rows, 0) if shared else None
    flat = list(rows.integers.reshape(3 * n_rows, length))
    return _write_steps(rows.steps) + encode_integers(flat, tables)


def read_rows(payload: bytes, n_rows: int, length: int, *, shared: bool) -> Quantized:
    """Undo `write_rows`: integers of shape (3, rows, length)."""
    steps, coded = _read_steps(payload, n_rows)
    tables = _shared_tables(n_rows, 0) if shared else None
    rows = decode_integers(coded, [length] * (3 * n_rows), tables)
    return Quantized(np.stack(rows).reshape(3, n_rows, length), steps)


def write_layout(layout: Layout) -> bytes:
    """How the fields of `reel` are cut; begins with the number of this very layout."""
    return b"".join(
        [
            bytes([FIELDS_LAYOUT]),
            struct.pack("<f", layout.step),
            _write_counts(layout.group_ends),
            _write_counts(layout.spacings),
            write_varint(layout.least_anchors),
        ]
    )


def read_layout(payload: bytes, n_modes: int) -> Layout:
    """Undo `write_layout`.

    Raises
    ------
    UnsupportedVersionError
        If it is of another build: the method is in the making.
    CorruptStreamError
        If it contradicts itself.
    """
    if payload[:1] != bytes([FIELDS_LAYOUT]):
        raise UnsupportedVersionError(
            f"the method reel is in the making: the stream has its layout {payload[:1].hex()}, "
            f"this build reads {FIELDS_LAYOUT:02x}; encode it again"
        )
    if len(payload) < 5:
        raise TruncatedStreamError("the layout of the fields is cut off")
    (step,) = struct.unpack_from("<f", payload, 1)
    ends, position = _read_counts(payload, 5)
    spacings, position = _read_counts(payload, position)
    least, position = read_varint(payload, position)
    falls = all(a > b for a, b in pairwise(spacings)) and 1 <= spacings[-1] <= spacings[0]
    rises = all(a < b for a, b in pairwise((0, *ends))) and ends[-1] == n_modes
    if not (falls and rises and spacings[0] <= MAX_SPACING and 0 < step < float("inf")):
        raise CorruptStreamError(
            f"fields of {n_modes} modes with groups to {ends}, spacings {spacings} and step {step}"
        )
    if position != len(payload):
        raise CorruptStreamError("bytes are left over behind the layout of the fields")
    return Layout(np.float32(step), ends, spacings, least)


def write_stages(stages: Sequence[Integers]) -> bytes:
    """Residuals of the anchors, stage after stage, each behind its length."""
    return b"".join(_with_length(encode_fields(stage, None)) for stage in stages)


def read_stages(payload: bytes, n_modes: int, lengths: Sequence[int]) -> tuple[Integers, ...]:
    """Undo `write_stages`: arrays of shape (K, A_i)."""
    stages, position = [], 0
    for length in lengths:
        coded, position = _read_with_length(payload, position)
        stages.append(decode_fields(coded, n_modes, length, None))
    if position != len(payload):
        raise CorruptStreamError("bytes are left over behind the anchors of the last stage")
    return tuple(stages)


def write_time_vectors(basis: Integers) -> bytes:
    """Time vectors, integers of shape (3, K, T): differenced curves, coded with their neighbours.

    Rows go mode by mode, x, y and z of each together; a time is the neighbour of the next.
    """
    n_modes, n_frames = basis.shape[1:]
    by_mode = np.swapaxes(basis, 0, 1).reshape(3 * n_modes, n_frames)
    differenced = [_best_difference(row) for row in by_mode]
    orders = encode_integers([np.array([order for order, _ in differenced], np.int64)])
    curves = np.stack([row for _, row in differenced])
    return _with_length(orders) + encode_fields(curves, _chain(n_frames))


def read_time_vectors(payload: bytes, n_modes: int, n_frames: int) -> Integers:
    """Undo `write_time_vectors`."""
    coded_orders, position = _read_with_length(payload, 0)
    (orders,) = decode_integers(coded_orders, [3 * n_modes])
    _check_orders(orders)
    curves = decode_fields(payload[position:], 3 * n_modes, n_frames, _chain(n_frames))
    for row, order in zip(curves, orders, strict=True):
        row[:] = _sum_up(row, int(order))
    return np.swapaxes(curves.reshape(n_modes, 3, n_frames), 0, 1)


def _chain(length: int) -> tuple[Integers, Integers]:
    """Neighbours of a line of columns: the one before and the one after."""
    columns = np.repeat(np.arange(length), 2)
    around = columns + np.tile([-1, 1], length)
    is_inside = (around >= 0) & (around < length)
    counts = np.bincount(columns[is_inside], minlength=length)
    return np.concatenate([[0], np.cumsum(counts)]), around[is_inside]


def _with_length(data: bytes) -> bytes:
    return write_varint(len(data)) + data


def _read_with_length(payload: bytes, position: int) -> tuple[bytes, int]:
    size, start = read_varint(payload, position)
    if size > len(payload) - start:
        raise TruncatedStreamError(f"{size} bytes are announced; {len(payload) - start} are left")
    return payload[start : start + size], start + size


def _check_orders(orders: Integers) -> None:
    if np.any((orders < 0) | (orders > MAX_DIFFERENCE)):
        raise CorruptStreamError(f"a row over time is differenced more than {MAX_DIFFERENCE} x")


def _write_counts(counts: Sequence[int]) -> bytes:
    return write_varint(len(counts)) + b"".join(map(write_varint, counts))


def _read_counts(payload: bytes, position: int) -> tuple[tuple[int, ...], int]:
    n_counts, position = read_varint(payload, position)
    if not 1 <= n_counts <= MAX_COUNTS:
        raise CorruptStreamError(f"{n_counts} groups or stages; 1 to {MAX_COUNTS} are allowed")
    counts = []
    for _ in range(n_counts):
        count, position = read_varint(payload, position)
        counts.append(count)
    return tuple(counts), position


def _best_difference(row: Integers) -> tuple[int, Integers]:
    """How often to difference a row in time so that its bits are fewest, and the result."""
    candidates = [row]
    for _ in range(MAX_DIFFERENCE):
        candidates.append(np.diff(candidates[-1], prepend=0))
    bits = [int(np.sum(np.frexp(np.abs(row).astype(float))[1])) for row in candidates]
    order = int(np.argmin(bits))
    return order, candidates[order]


def _sum_up(row: Integers, order: int) -> Integers:
    for _ in range(order):
        row = np.cumsum(row)
    return row


def _shared_tables(n_modes: int, first: int) -> list[int]:
    """Table of each row: modes 1, 2-3, 4-7, ... of all axes share one."""
    return [first + (mode + 1).bit_length() - 1 for mode in range(n_modes)] * 3


def _write_steps(steps: Steps) -> bytes:
    return write_varint(len(steps)) + steps.astype("<f4").tobytes()


def _read_steps(payload: bytes, n_rows: int) -> tuple[Steps, bytes]:
    n_steps, start = read_varint(payload, 0)
    if n_steps not in (1, n_rows):
        raise CorruptStreamError(f"{n_steps} steps are announced for {n_rows} rows; 1 or as many")
    end = start + 4 * n_steps
    if end > len(payload):
        raise TruncatedStreamError("a section ends inside its quantisation steps")
    steps = np.frombuffer(payload[start:end], "<f4").astype(np.float32)
    if not (np.isfinite(steps) & (steps >= 0)).all():
        raise CorruptStreamError("a quantisation step is not a positive number")
    return steps, payload[end:]
