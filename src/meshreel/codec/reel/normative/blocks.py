"""Sections of a block of `reel`, `lossless` and `grid`, laid out as in `docs/format.md`."""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.codec.bitstream.container import write_block_counts, write_varint, write_varints
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.normative.fields import FieldBlock, Layout
from meshreel.codec.reel.normative.grid import EXACT, ON_SURFACE, STILL, write_form
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.basis import BY_TIMES, BasisCoding, Rests, time_order
from meshreel.kernel.exact import encode_exact
from meshreel.kernel.fields import encode_fields
from meshreel.kernel.frames import FrameCorrections
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.mesh import Neighbors
from meshreel.kernel.surface_integers import encode_on_surface
from meshreel.model.sequence import Faces

Numbers = npt.NDArray[Any]

SINGLE, DOUBLE = 4, 8
"""Layout codes, named after the precision in which frames are summed."""

WITH_RESTS = 16
"""Flag of the layout: the block has resting times."""

WITH_COSINES = 32
"""Flag of the layout: the basis is coded as coefficients of cosines over time."""

ADAPTIVE = 64
"""Flag of the layout: the prediction weights of the basis adapt."""

WITH_RELATED = 32
"""Flag of the code of a nugget: the fields are related to those of another track."""

FROM_POINTS = 128
"""Flag of the layout: the initial weights of the fields follow from points."""


@dataclass(frozen=True)
class Corrections:
    """Displacements of positions of a block, as multiples of a step; they guarantee an error bound.

    Positions that violate the bound cluster in vertices and runs of frames, and are coded
    accordingly.
    """

    step: np.float32
    """Quantization step of the displacements, in diagonals."""
    vertices: Integers
    frames: Integers
    """int64 arrays of shape (N,). Internal vertex numbers and frames of the block, ordered by
    vertex, then frame.
    """
    offsets: Integers
    """int64 array of shape (N, 3)."""

    @property
    def displacements(self) -> Floats:
        """Displacements of shape (N, 3), in diagonals."""
        return np.asarray(self.offsets * float(self.step))

    def by_frame(self, n_frames: int) -> FrameCorrections:
        """Group the displacements by frame, with ascending vertices."""
        order = np.lexsort((self.vertices, self.frames))
        starts = np.searchsorted(self.frames[order], np.arange(n_frames + 1))
        vertices = self.vertices[order].astype(np.int32)
        displacements = np.ascontiguousarray(self.displacements[order])
        return FrameCorrections(starts.astype(np.int64), vertices, displacements)


def write_field_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> list[tuple[Section, bytes]]:
    """Return the sections of positions coded as fields; they begin a block."""
    n_modes, _, n_frames = block.basis.shape
    sections = _field_sections(block, mesh, corrections)
    return [(Section.BLOCK, write_block_counts(n_frames, n_modes)), *sections]


def write_track_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> list[tuple[Section, bytes]]:
    """Return the sections of a block of a track coded as fields."""
    opening = Section.TRACK_BLOCK, write_varint(block.n_modes)
    return [opening, *_field_sections(block, mesh, corrections)]


def write_exact_positions(
    values: Numbers, graph: Neighbors, form: bytes = b""
) -> list[tuple[Section, bytes]]:
    """Return the sections of positions coded as exact values, of shape (T_b, V, 3).

    Parameters
    ----------
    values : array of shape (T_b, V, 3)
        Positions or grid coordinates, in internal order.
    form : bytes
        Form of the method `grid`.
    """
    return [
        (Section.BLOCK, write_block_counts(len(values), 0)),
        (Section.VALUES, form + encode_exact(values, graph)),
    ]


def write_on_surface(
    values: Numbers,
    step: float,
    faces: Faces,
    twins: npt.NDArray[np.int32],
    rounding: bytes | None = None,
    *,
    n_frames: int = 1,
) -> list[tuple[Section, bytes]]:
    """Return the sections of a block of positions on a grid, coded along the surface.

    Parameters
    ----------
    values : int32 array of shape (n_frames, V, 3), or (1, V, 3) of equal frames
        Grid coordinates, in internal order, up to `MAX_VALUE` in magnitude.
    step : float
        Above 0.
    faces : int32 array of shape (M, 3)
        In internal order.
    twins : int32 array of shape (3 M,)
        The other side at the edge of each side, or the side itself.
    rounding : bytes or None
        As of `PositionGrid.rounding`, so that positions are exact.
    n_frames : int
    """
    form = ON_SURFACE if len(values) == n_frames else ON_SURFACE | STILL
    return [
        (Section.BLOCK, write_block_counts(n_frames, 0)),
        *([] if rounding is None else [(Section.ROUNDING, rounding)]),
        (Section.VALUES, write_form(form, step) + encode_on_surface(values, faces, twins)),
    ]


def write_values_block(
    values: Numbers, graph: Neighbors, step: float | None = None
) -> list[tuple[Section, bytes]]:
    """Return the sections of a block of a track without modes.

    Parameters
    ----------
    values : array of shape (T_b, N, C)
        Values of a lossless track, or int32 coordinates on a grid, in internal order.
    step : float, optional
        Of the grid, in diagonals of the range.
    """
    form = b"" if step is None else write_form(EXACT, step)
    payload = form + encode_exact(values, graph)
    return [(Section.TRACK_BLOCK, write_varint(0)), (Section.VALUES, payload)]


def write_missing(is_missing: npt.NDArray[np.bool_], graph: Neighbors) -> tuple[Section, bytes]:
    """Return the section with the mask, of shape (T_b, N, C), of missing values in a block."""
    return Section.MISSING, encode_exact(is_missing, graph)


def _field_sections(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None
) -> list[tuple[Section, bytes]]:
    """Return the sections of a track coded as fields, which follow the opening of the block."""
    layout = block.layout
    basis = write_basis(block.basis, layout.coding)
    sections = [(Section.FIELDS, write_layout(layout)), (Section.BASIS, basis)]
    if corrections is not None:
        sections.append((Section.CORRECTIONS, write_corrections(corrections)))
    return [*sections, (Section.COEFFICIENTS, encode_fields(block.fields, mesh.coding_order))]


def write_layout(layout: Layout) -> bytes:
    """Encode the layout of a block, starting with its code."""
    coding, number = layout.coding, SINGLE if layout.is_single else DOUBLE
    number |= WITH_RESTS if coding.rests.runs else 0
    number |= WITH_COSINES if coding.has_cosines else 0
    number |= ADAPTIVE if coding.is_adaptive else 0
    number |= 0 if layout.nugget is None else FROM_POINTS
    parts = [
        bytes([number]),
        write_varint(layout.reference),
        struct.pack("<f", layout.step),
        write_varints(layout.stencil_size, layout.n_learned),
    ]
    if layout.nugget is not None:
        parts.append(bytes([layout.nugget | (WITH_RELATED if layout.related else 0)]))
        parts.append(write_varint(layout.related) if layout.related else b"")
    if coding.rests.runs:
        parts.append(_write_rests(coding.rests))
    if layout.n_reused:
        parts += [write_varint(layout.n_reused), struct.pack("<f", layout.finer)]
    return b"".join(parts)


def _write_rests(rests: Rests) -> bytes:
    """Encode the resting times of a block."""
    numbers, previous_end = [len(rests.runs)], 0
    for start, end in rests.runs:
        numbers += [start - previous_end, end - start]
        previous_end = end
    return bytes([rests.bits]) + write_varints(*numbers)


def write_basis(integers: npt.NDArray[np.integer], coding: BasisCoding = BY_TIMES) -> bytes:
    """Encode the integers of the temporal basis, of shape (K, C, T)."""
    n_modes, n_columns, n_frames = integers.shape
    rows = integers.reshape(n_modes, n_columns * n_frames)
    return encode_fields(rows, time_order(n_columns, n_frames, coding))


def write_corrections(corrections: Corrections) -> bytes:
    """Encode the corrections of a block: vertices, their numbers of frames, frames, offsets."""
    vertices, counts = np.unique(corrections.vertices, return_counts=True)
    firsts = np.cumsum(counts) - counts
    frame_steps = np.diff(corrections.frames, prepend=0)
    frame_steps[firsts] = corrections.frames[firsts]
    follows = frame_steps == 1
    follows[firsts] = False
    # In a run of frames, an offset resembles the previous one.
    offsets = corrections.offsets.copy()
    offsets[follows] -= corrections.offsets[np.flatnonzero(follows) - 1]
    columns = [np.diff(vertices, prepend=0), counts - 1, frame_steps, *offsets.T]
    tables = [0, 1, 2, *[3] * len(offsets.T)]
    rows = [np.asarray(column, np.int64) for column in columns]
    return b"".join(
        [
            struct.pack("<f", corrections.step),
            write_varints(len(vertices), len(corrections.vertices)),
            encode_integers(rows, tables),
        ]
    )
