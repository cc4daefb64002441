"""Sections of a block, and how the encoder reads back what it wrote."""

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.bitstream.container import write_block_counts, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.open_stream import StoredBlock
from meshreel.codec.reel.normative import payloads
from meshreel.codec.reel.normative.fields import FieldBlock, KeyFields, Layout, decoded_values
from meshreel.codec.reel.normative.grid import write_step
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.errors import CorruptStreamError
from meshreel.kernel.basis import MAX_COSINES
from meshreel.kernel.exact import encode_exact
from meshreel.kernel.fields import decode_fields
from meshreel.kernel.mesh import Neighbors
from meshreel.kernel.predict import Prepared, prepared_weights
from meshreel.kernel.surface_integers import encode_on_surface
from meshreel.model.sequence import Faces
from meshreel.runtime.threads import in_background, n_cores

Numbers = npt.NDArray[Any]

POSITION_COLUMNS = 3
"""Columns of positions: x, y and z."""


def write_field_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> Iterator[tuple[Section, bytes]]:
    """Yield the sections of positions coded as fields; they begin a block."""
    n_modes, _, n_frames = block.basis.shape
    opening = Section.BLOCK, write_block_counts(n_frames, n_modes)
    yield from [opening, *payloads.field_sections(block, mesh, corrections)]


def write_track_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> Iterator[tuple[Section, bytes]]:
    """Yield the sections of a block of a track coded as fields."""
    opening = Section.TRACK_BLOCK, write_varint(block.n_modes)
    yield from [opening, *payloads.field_sections(block, mesh, corrections)]


def write_exact_positions(vertices: Numbers, graph: Neighbors) -> list[tuple[Section, bytes]]:
    """Return the sections of lossless positions of shape (T_b, V, 3), in internal order."""
    return [
        (Section.BLOCK, write_block_counts(len(vertices), 0)),
        (Section.VALUES, encode_exact(vertices, graph)),
    ]


def write_grid_positions(
    values: Numbers, step: float, graph: Neighbors
) -> list[tuple[Section, bytes]]:
    """Return the sections of positions of the method `grid`.

    Parameters
    ----------
    values : array of shape (T_b, V, 3)
        Grid coordinates, or lossless positions if the step is `NO_GRID`; in internal order.
    step : float
    graph : Neighbors
    """
    return [
        (Section.BLOCK, write_block_counts(len(values), 0)),
        (Section.VALUES, write_step(step) + encode_exact(values, graph)),
    ]


def write_grid_frame(
    values: Numbers, step: float, faces: Faces, twins: npt.NDArray[np.int32]
) -> list[tuple[Section, bytes]]:
    """Return the sections of a block of one frame of the method `grid`.

    Parameters
    ----------
    values : int32 array of shape (1, V, 3)
        Grid coordinates, in internal order, up to `MAX_VALUE` in magnitude.
    step : float
        Above 0.
    faces : int32 array of shape (M, 3)
        In internal order.
    twins : int32 array of shape (3 M,)
        The other side at the edge of each side, or the side itself.
    """
    return [
        (Section.BLOCK, write_block_counts(1, 0)),
        (Section.VALUES, write_step(step) + encode_on_surface(values[0], faces, twins)),
    ]


def write_exact_block(values: Numbers, graph: Neighbors) -> list[tuple[Section, bytes]]:
    """Return the sections of a block of a lossless track, with values of shape (T_b, N, C)."""
    return [
        (Section.TRACK_BLOCK, write_varint(0)),
        (Section.VALUES, encode_exact(values, graph)),
    ]


def write_missing(is_missing: npt.NDArray[np.bool_], graph: Neighbors) -> tuple[Section, bytes]:
    """Return the section with the mask, of shape (T_b, N, C), of missing values in a block."""
    return Section.MISSING, encode_exact(is_missing, graph)


def read_corrections(
    stored: StoredBlock, n_verts: int, n_columns: int = POSITION_COLUMNS
) -> Corrections | None:
    """Decode the corrections of a track in a block, if it has any."""
    if Section.CORRECTIONS not in stored.sections:
        return None
    payload = stored.payload(Section.CORRECTIONS)
    return payloads.read_corrections(payload, n_columns, stored.n_frames, n_verts, stored.limit)


@dataclass(frozen=True)
class ReadBlock:
    """Integers of a track in a block; the basis and initial weights may still be computed.

    Attributes
    ----------
    layout : Layout
    basis_future : Future of an int32 array of shape (K, C, T)
        Residuals of the temporal basis.
    fields : int32 array of shape (K - n_reused, V)
    weights : Future of Prepared, or None
        Initial prediction weights; None if decoding computes them.
    """

    layout: Layout
    basis_future: Future[npt.NDArray[np.int32]]
    fields: npt.NDArray[np.int32]
    weights: Future[Prepared | None] | None

    @property
    def basis(self) -> npt.NDArray[np.int32]:
        """Residuals of the temporal basis; waits for the background thread."""
        return self.basis_future.result()

    def values(self, mesh: FieldMesh, key: KeyFields | None = None) -> Floats:
        """Decode fields of shape (V, K), in coding order and in steps."""
        return decoded_values(self.fields, self.layout, mesh, key, self.weights)


def layout_of(stored: StoredBlock) -> Layout:
    """Return the layout of a track in a block.

    Raises
    ------
    CorruptStreamError, UnsupportedVersionError
        As `payloads.read_layout`, or if the layout contradicts the number of modes or frames.
    """
    layout = payloads.read_layout(stored.payload(Section.FIELDS))
    if layout.n_reused > stored.n_modes:
        raise CorruptStreamError(f"{layout.n_reused} of {stored.n_modes} modes are reused")
    if layout.rests.runs and layout.rests.runs[-1][1] > stored.n_frames:
        raise CorruptStreamError(
            f"times up to {layout.rests.runs[-1][1] - 1} rest in a block of {stored.n_frames}"
        )
    if layout.has_cosines and stored.n_frames > MAX_COSINES:
        raise CorruptStreamError(
            f"a block of {stored.n_frames} frames has cosines over time; at most {MAX_COSINES} "
            "frames are allowed"
        )
    return layout


def read_field_block(
    stored: StoredBlock,
    layout: Layout,
    mesh: FieldMesh,
    key: KeyFields | None = None,
    *,
    n_columns: int = POSITION_COLUMNS,
) -> ReadBlock:
    """Decode the integers of a track in a block, basis and fields in parallel.

    Parameters
    ----------
    stored : StoredBlock
    layout : Layout
        Layout of the block.
    mesh : FieldMesh
    key : KeyFields, optional
        Fields of the block that this one refers to, for the initial weights.
    n_columns : int
    """
    n_modes, n_frames = stored.n_modes, stored.n_frames
    times, coded = stored.payload(Section.BASIS), stored.payload(Section.COEFFICIENTS)
    shape = n_modes, n_columns, n_frames
    basis_future = in_background(
        lambda: payloads.read_basis(
            times, *shape, rests=layout.rests, has_cosines=layout.has_cosines
        )
    )
    weights = _initial_weights(mesh, layout, key)
    fields = decode_fields(coded, n_modes - layout.n_reused, mesh.n_verts, mesh.coding_order)
    return ReadBlock(layout, basis_future, fields, weights)


def _initial_weights(
    mesh: FieldMesh, layout: Layout, key: KeyFields | None
) -> Future[Prepared | None] | None:
    """Start computing initial weights in the background; None if this saves no time."""
    if n_cores() == 1 or (key is not None and key.is_prepared(layout.n_learned)):
        return None
    if key is not None:
        return in_background(partial(key.prepared, mesh, layout.n_learned))
    if mesh.is_large and not layout.reference:
        return in_background(partial(prepared_weights, mesh.hierarchy, 0))
    return None
