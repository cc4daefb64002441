"""Integers to the payloads of sections and back: the layouts of `docs/format.md`."""

import struct
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.field_coder import decode_fields, encode_fields
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from meshreel.paper.pipeline import Quantized
from meshreel.paper.quantization.uniform import Steps
from meshreel.reel.agreed.corrections import Corrections
from meshreel.reel.agreed.fields import MAX_TAP, N_TAPS, Layout
from meshreel.reel.agreed.timeline import COARSEST, time_passes
from meshreel.runtime.profiling import staged

Integers = npt.NDArray[np.int64]

MAX_DIFFERENCE = 2

ALONE, REFERRING = 4, 5
"""Layouts of the sections of `reel`, without and with a key block; 1 to 3 were of the method in the
making."""

MAX_COUNTS = 32
"""Most groups of modes."""

MAX_STENCIL = 16
"""Most vertices that foretell one."""

MAX_STEP = 1e6
"""Steps are below this: a million diagonals times the square root of the frames."""


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


def write_layout(layout: Layout, taps: Integers) -> bytes:
    """How the fields of `reel` are cut and filtered; begins with the number of this layout."""
    return b"".join(
        [
            bytes([REFERRING]) + write_varint(layout.reference)
            if layout.reference
            else bytes([ALONE]),
            struct.pack("<f", layout.step),
            _write_counts(layout.group_ends),
            write_varint(layout.stencil_size),
            encode_integers(list(taps.T)),
        ]
    )


def read_layout(payload: bytes, n_modes: int) -> tuple[Layout, Integers]:
    """Undo `write_layout`: the layout, and taps of shape (K, N_TAPS).

    Raises
    ------
    UnsupportedVersionError
        If it is of a newer build, or of one from before the method was settled.
    CorruptStreamError
        If it contradicts itself.
    """
    if not payload:
        raise TruncatedStreamError("the layout of the fields is cut off")
    if payload[0] not in (ALONE, REFERRING):
        remedy = "upgrade meshreel" if payload[0] > REFERRING else "encode the original again"
        raise UnsupportedVersionError(
            f"the fields of the stream have layout {payload[0]}; this build reads {ALONE} and "
            f"{REFERRING}; {remedy}"
        )
    reference, position = read_varint(payload, 1) if payload[0] == REFERRING else (0, 1)
    if payload[0] == REFERRING and not reference:
        raise CorruptStreamError("a block refers to itself")
    if len(payload) < position + 4:
        raise TruncatedStreamError("the layout of the fields is cut off")
    (step,) = struct.unpack_from("<f", payload, position)
    ends, position = _read_counts(payload, position + 4)
    stencil_size, position = read_varint(payload, position)
    rises = all(a < b for a, b in pairwise((0, *ends))) and ends[-1] == n_modes
    if not (rises and 1 <= stencil_size <= MAX_STENCIL and 0 < step < MAX_STEP):
        raise CorruptStreamError(
            f"fields of {n_modes} modes with groups to {ends}, stencils of {stencil_size} and step "
            f"{step}"
        )
    taps = np.stack(decode_integers(payload[position:], [n_modes] * N_TAPS), axis=1)
    if np.abs(taps).max() > MAX_TAP:
        raise CorruptStreamError(f"a filter has a tap beyond {MAX_TAP}")
    return Layout(np.float32(step), ends, stencil_size, reference), taps


@staged("time vectors")
def write_times(times: Integers) -> bytes:
    """Steps of time vectors, of shape (T, 3 K); those of the coarsest times are differenced."""
    n_frames = len(times)
    rows = times.T.copy()
    rows[:, ::COARSEST] = np.diff(rows[:, ::COARSEST], axis=1, prepend=0)
    return encode_fields(rows.reshape(-1, 3 * n_frames), time_passes(n_frames))


@staged("time vectors")
def read_times(payload: bytes, n_modes: int, n_frames: int) -> Integers:
    """Undo `write_times`."""
    coded = decode_fields(payload, n_modes, 3 * n_frames, time_passes(n_frames))
    rows = coded.reshape(3 * n_modes, n_frames)
    rows[:, ::COARSEST] = np.cumsum(rows[:, ::COARSEST], axis=1)
    return rows.T


@staged("corrections")
def write_corrections(corrections: Corrections) -> bytes:
    """Corrections of a block: vertices with their number of frames, frames, offsets."""
    vertices, counts = np.unique(corrections.vertices, return_counts=True)
    firsts = np.cumsum(counts) - counts
    frame_steps = _first_or_difference(corrections.frames, firsts)
    follows = _follows(frame_steps, firsts)
    # In a run of frames an offset resembles the one before.
    offsets = corrections.offsets.copy()
    offsets[follows] -= corrections.offsets[np.flatnonzero(follows) - 1]
    columns = [np.diff(vertices, prepend=0), counts - 1, frame_steps, *offsets.T]
    return b"".join(
        [
            struct.pack("<f", corrections.step),
            write_varint(len(vertices)),
            write_varint(len(corrections.vertices)),
            encode_integers(
                [np.asarray(column, np.int64) for column in columns], [0, 1, 2, 3, 3, 3]
            ),
        ]
    )


@staged("corrections")
def read_corrections(payload: bytes, n_frames: int, n_verts: int) -> Corrections:
    """Undo `write_corrections`.

    Raises
    ------
    CorruptStreamError
        If a vertex or frame is out of range, or the numbers do not fit each other.
    """
    if len(payload) < 4:
        raise TruncatedStreamError("the corrections are cut off")
    (step,) = struct.unpack_from("<f", payload, 0)
    n_corrected, position = read_varint(payload, 4)
    n_offsets, position = read_varint(payload, position)
    if not (n_corrected <= n_verts and n_corrected <= n_offsets <= n_frames * n_verts):
        raise CorruptStreamError(
            f"{n_offsets} corrections of {n_corrected} vertices are announced, for {n_frames} "
            f"frames of {n_verts}"
        )
    lengths = [n_corrected, n_corrected, *[n_offsets] * 4]
    columns = decode_integers(payload[position:], lengths, [0, 1, 2, 3, 3, 3])
    vertices, counts = np.cumsum(columns[0]), columns[1] + 1
    if np.any(counts < 1) or int(counts.sum()) != n_offsets:
        raise CorruptStreamError("the corrections of the vertices are not as many as announced")
    firsts = np.cumsum(counts) - counts
    frames = _sum_up_from(columns[2], firsts)
    follows = _follows(columns[2], firsts)
    offsets = _sum_up_from(np.stack(columns[3:], axis=1), np.flatnonzero(~follows))
    is_later = columns[2] > 0
    is_later[firsts] = True
    ascends = np.all(np.diff(vertices, prepend=-1) > 0) and bool(is_later.all())
    exists = np.all(vertices < n_verts) and not np.any((frames < 0) | (frames >= n_frames))
    if not (ascends and exists and 0 < step < MAX_STEP):
        raise CorruptStreamError(
            "a correction is of a vertex or frame that does not exist, or out of order"
        )
    return Corrections(np.float32(step), np.repeat(vertices, counts), frames, offsets)


def write_promise(max_error_percent: float) -> bytes:
    """What the encoder made sure of: the largest displacement of a vertex."""
    return struct.pack("<d", max_error_percent)


def read_promise(payload: bytes) -> float:
    """Undo `write_promise`.

    Raises
    ------
    CorruptStreamError
        If it is no positive number.
    """
    if len(payload) != 8:
        raise CorruptStreamError(f"a promise has 8 bytes; this one has {len(payload)}")
    (max_error_percent,) = struct.unpack("<d", payload)
    if not 0 < max_error_percent < float("inf"):
        raise CorruptStreamError(f"a maximum error of {max_error_percent} is promised")
    return float(max_error_percent)


def _first_or_difference(values: Integers, firsts: Integers) -> Integers:
    """Differences to the value before; of the first of each stretch the value."""
    steps = np.diff(values, prepend=0)
    steps[firsts] = values[firsts]
    return steps


def _follows(frame_steps: Integers, firsts: Integers) -> npt.NDArray[np.bool_]:
    """Whether a correction is of the frame after the one before it, of the same vertex."""
    follows = np.asarray(frame_steps == 1)
    follows[firsts] = False
    return follows


def _sum_up_from(steps: Integers, firsts: Integers) -> Integers:
    """Running sums of rows that begin anew at the first of each stretch."""
    if not len(steps):
        return steps
    summed = np.cumsum(steps, axis=0)
    stretch = np.zeros(len(steps), np.int64)
    stretch[firsts] = 1
    before = (summed - steps)[firsts]
    return np.asarray(summed - before[np.cumsum(stretch) - 1])


def _check_orders(orders: Integers) -> None:
    if np.any((orders < 0) | (orders > MAX_DIFFERENCE)):
        raise CorruptStreamError(f"a row over time is differenced more than {MAX_DIFFERENCE} x")


def _write_counts(counts: Sequence[int]) -> bytes:
    return write_varint(len(counts)) + b"".join(map(write_varint, counts))


def _read_counts(payload: bytes, position: int) -> tuple[tuple[int, ...], int]:
    n_counts, position = read_varint(payload, position)
    if not 1 <= n_counts <= MAX_COUNTS:
        raise CorruptStreamError(f"{n_counts} groups of modes; 1 to {MAX_COUNTS} are allowed")
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
