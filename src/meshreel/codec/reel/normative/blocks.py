"""Sections of a block."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import write_block_counts, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.reel.normative import payloads
from meshreel.codec.reel.normative.fields import FieldBlock
from meshreel.codec.reel.normative.grid import write_step
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.exact import encode_exact
from meshreel.kernel.mesh import Neighbors
from meshreel.kernel.surface_integers import encode_on_surface
from meshreel.model.sequence import Faces

Numbers = npt.NDArray[Any]


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
