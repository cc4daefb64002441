"""Payloads of the sections of `reel`, laid out as in `docs/format.md`."""

import struct

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.bitstream.container import read_varint, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.memory import DEFAULT_LIMIT, MemoryLimit
from meshreel.codec.reel.normative.fields import FieldBlock, Layout
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.reel.normative.timeline import time_order
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from meshreel.kernel.basis import MAX_REST_BITS, NO_REST, Rests
from meshreel.kernel.fields import decode_fields, encode_fields
from meshreel.kernel.integers import decode_integers, encode_integers
from meshreel.kernel.mesh import MAX_STENCIL

SINGLE, DOUBLE = 4, 8
"""Layout codes, named after the precision in which frames are summed."""

WITH_RESTS = 16
"""Flag of the layout: the block has resting times."""

WITH_COSINES = 32
"""Flag of the layout: the basis is coded as coefficients of cosines over time."""

ADAPTIVE = 64
"""Flag of the layout: the basis is coded by adaptive times."""

INTEGER_BYTES = 8
"""Size of a decoded integer of corrections: a vertex, frame or offset."""

MAX_LEARNED = 255
"""Maximum number of modes that prediction weights adapt to."""

MAX_STEP = 1e6
"""Upper limit of steps: a million diagonals times the square root of the number of frames."""


def field_sections(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None
) -> list[tuple[Section, bytes]]:
    """Return the sections of a track coded as fields, which follow the opening of the block."""
    layout = block.layout
    basis = write_basis(block.basis, layout.rests, has_cosines=layout.has_cosines)
    sections = [(Section.FIELDS, write_layout(layout)), (Section.BASIS, basis)]
    if corrections is not None:
        sections.append((Section.CORRECTIONS, write_corrections(corrections)))
    return [*sections, (Section.COEFFICIENTS, encode_fields(block.fields, mesh.coding_order))]


def write_layout(layout: Layout) -> bytes:
    """Encode the layout of a block, starting with its code."""
    number = SINGLE if layout.is_single else DOUBLE
    number |= WITH_RESTS if layout.rests.runs else 0
    number |= WITH_COSINES if layout.has_cosines else 0
    number |= ADAPTIVE if layout.is_adaptive else 0
    parts = [
        bytes([number]),
        write_varint(layout.reference),
        struct.pack("<f", layout.step),
        write_varint(layout.stencil_size),
        write_varint(layout.n_learned),
        _write_rests(layout.rests),
    ]
    if layout.n_reused:
        parts += [write_varint(layout.n_reused), struct.pack("<f", layout.finer)]
    return b"".join(parts)


def read_layout(payload: bytes) -> Layout:
    """Decode the layout of a block.

    Raises
    ------
    UnsupportedVersionError
        If the layout code is unknown.
    CorruptStreamError
        If a value is out of range, or values contradict each other.
    """
    if not payload:
        raise TruncatedStreamError("the layout of the fields is cut off")
    precision = payload[0] & ~(WITH_RESTS | WITH_COSINES | ADAPTIVE)
    if precision not in (SINGLE, DOUBLE):
        raise UnsupportedVersionError(
            f"fields have layout {payload[0]}; this build reads {SINGLE} and {DOUBLE}, plus flags "
            f"{WITH_RESTS}, {WITH_COSINES} and {ADAPTIVE}; upgrade meshreel"
        )
    if payload[0] & WITH_COSINES and payload[0] & (WITH_RESTS | ADAPTIVE):
        raise CorruptStreamError(
            "a block combines cosines over time with resting or adaptive times, which exclude them"
        )
    reference, position = read_varint(payload, 1)
    if len(payload) < position + 4:
        raise TruncatedStreamError("the layout of the fields is cut off")
    (step,) = struct.unpack_from("<f", payload, position)
    stencil_size, position = read_varint(payload, position + 4)
    n_learned, position = read_varint(payload, position)
    rests, n_reused, finer = NO_REST, 0, 0.0
    if payload[0] & WITH_RESTS:
        rests, position = _read_rests(payload, position)
    if reference and position < len(payload):
        n_reused, position = read_varint(payload, position)
        if len(payload) < position + 4:
            raise TruncatedStreamError("the layout of the fields is cut off")
        (finer,) = struct.unpack_from("<f", payload, position)
        position += 4
        if not (n_reused and 0 < finer < MAX_STEP):
            raise CorruptStreamError(
                f"a block reuses {n_reused} fields, with vectors {finer} times as fine; both must "
                f"be above 0, and the factor below {MAX_STEP:g}"
            )
    is_sound = 1 <= stencil_size <= MAX_STENCIL and 0 < step < MAX_STEP
    if not is_sound or n_learned > MAX_LEARNED or position != len(payload):
        raise CorruptStreamError(
            f"invalid layout: stencils of {stencil_size} vertices (1..{MAX_STENCIL}), step {step} "
            f"(above 0, below {MAX_STEP:g}), {n_learned} learned modes (at most {MAX_LEARNED}), "
            f"{len(payload) - position} unread bytes (0)"
        )
    is_single = precision == SINGLE
    single = np.float32
    return Layout(
        single(step),
        stencil_size,
        n_learned,
        reference,
        is_single,
        n_reused,
        single(finer),
        rests,
        bool(payload[0] & WITH_COSINES),
        bool(payload[0] & ADAPTIVE),
    )


def _write_rests(rests: Rests) -> bytes:
    """Encode the resting times of a block; empty without any."""
    if not rests.runs:
        return b""
    parts, previous_end = [bytes([rests.bits]), write_varint(len(rests.runs))], 0
    for start, end in rests.runs:
        parts += [write_varint(start - previous_end), write_varint(end - start)]
        previous_end = end
    return b"".join(parts)


def _read_rests(payload: bytes, position: int) -> tuple[Rests, int]:
    """Decode resting times; return them with the position after them."""
    bits, position = read_varint(payload, position)
    n_runs, position = read_varint(payload, position)
    runs, end = [], 0
    for _ in range(n_runs):
        gap, position = read_varint(payload, position)
        length, position = read_varint(payload, position)
        if not (gap and length):
            raise CorruptStreamError(
                f"{length} resting times follow {gap} moving ones; both numbers must be above 0"
            )
        runs.append((end + gap, end + gap + length))
        end += gap + length
    if not runs or bits > MAX_REST_BITS:
        raise CorruptStreamError(
            f"a block has {n_runs} runs of resting times, of {bits} bits; at least 1 run and at "
            f"most {MAX_REST_BITS} bits are allowed"
        )
    return Rests(tuple(runs), bits), position


def write_basis(
    coded: npt.NDArray[np.integer], rests: Rests = NO_REST, *, has_cosines: bool = False
) -> bytes:
    """Encode the integers of the temporal basis, of shape (K, C, T)."""
    n_modes, n_columns, n_frames = coded.shape
    rows = coded.reshape(n_modes, n_columns * n_frames)
    return encode_fields(rows, time_order(n_columns, n_frames, rests, has_cosines=has_cosines))


def read_basis(
    payload: bytes,
    n_modes: int,
    n_columns: int,
    n_frames: int,
    rests: Rests = NO_REST,
    *,
    has_cosines: bool = False,
) -> npt.NDArray[np.int32]:
    """Decode the integers of `write_basis`."""
    order = time_order(n_columns, n_frames, rests, has_cosines=has_cosines)
    coded = decode_fields(payload, n_modes, n_columns * n_frames, order)
    return coded.reshape(len(coded), n_columns, n_frames)


def write_corrections(corrections: Corrections) -> bytes:
    """Encode the corrections of a block: vertices, their numbers of frames, frames, offsets."""
    vertices, counts = np.unique(corrections.vertices, return_counts=True)
    firsts = np.cumsum(counts) - counts
    frame_steps = _first_or_difference(corrections.frames, firsts)
    follows = _follows(frame_steps, firsts)
    # In a run of frames, an offset resembles the previous one.
    offsets = corrections.offsets.copy()
    offsets[follows] -= corrections.offsets[np.flatnonzero(follows) - 1]
    columns = [np.diff(vertices, prepend=0), counts - 1, frame_steps, *offsets.T]
    tables = [0, 1, 2, *[3] * len(offsets.T)]
    rows = [np.asarray(column, np.int64) for column in columns]
    return b"".join(
        [
            struct.pack("<f", corrections.step),
            write_varint(len(vertices)),
            write_varint(len(corrections.vertices)),
            encode_integers(rows, tables),
        ]
    )


def read_corrections(
    payload: bytes,
    n_columns: int,
    n_frames: int,
    n_verts: int,
    limit: MemoryLimit = DEFAULT_LIMIT,
) -> Corrections:
    """Decode corrections.

    Raises
    ------
    CorruptStreamError
        If a vertex or frame is out of range or order, or the counts contradict each other.
    MemoryLimitError
        If the decoded corrections exceed the limit.
    """
    if len(payload) < 4:
        raise TruncatedStreamError("the corrections are cut off")
    (step,) = struct.unpack_from("<f", payload, 0)
    n_corrected, position = read_varint(payload, 4)
    n_offsets, position = read_varint(payload, position)
    if not (n_corrected <= n_verts and n_corrected <= n_offsets <= n_frames * n_verts):
        raise CorruptStreamError(
            f"{n_offsets} corrections of {n_corrected} vertices do not fit {n_frames} frames of "
            f"{n_verts} vertices"
        )
    limit.require(INTEGER_BYTES * n_offsets * (n_columns + 3), f"{n_offsets} corrections")
    lengths = [n_corrected, n_corrected, n_offsets, *[n_offsets] * n_columns]
    columns = decode_integers(payload[position:], lengths, [0, 1, 2, *[3] * n_columns])
    vertices, counts = np.cumsum(columns[0]), columns[1] + 1
    if np.any(counts < 1) or int(counts.sum()) != n_offsets:
        raise CorruptStreamError("the corrections per vertex do not add up to their total")
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
            "a correction has a vertex or frame out of range or order, or the step is invalid"
        )
    return Corrections(np.float32(step), np.repeat(vertices, counts), frames, offsets)


def _first_or_difference(values: Integers, firsts: Integers) -> Integers:
    """Differences to the previous value; at the first of each run, the value."""
    steps = np.diff(values, prepend=0)
    steps[firsts] = values[firsts]
    return steps


def _follows(frame_steps: Integers, firsts: Integers) -> npt.NDArray[np.bool_]:
    """Whether each correction has the vertex and the next frame of the previous one."""
    follows = np.asarray(frame_steps == 1)
    follows[firsts] = False
    return follows


def _sum_up_from(steps: Integers, firsts: Integers) -> Integers:
    """Cumulative sums of rows that restart at the first of each run."""
    if not len(steps):
        return steps
    summed = np.cumsum(steps, axis=0)
    is_first = np.zeros(len(steps), np.int64)
    is_first[firsts] = 1
    before = (summed - steps)[firsts]
    return np.asarray(summed - before[np.cumsum(is_first) - 1])
