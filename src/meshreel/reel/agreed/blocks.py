"""Blocks of `reel` to sections and back."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import MAX_NUMBERS_PER_BYTE, Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.stored_blocks import StoredBlock, write_block
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError
from meshreel.kernel.exact import decode_exact, encode_exact
from meshreel.kernel.fields import decode_fields, encode_fields
from meshreel.kernel.mesh import Neighbours
from meshreel.kernel.predict import Prepared, prepared_weights
from meshreel.reel.agreed import payloads
from meshreel.reel.agreed.fields import FieldBlock
from meshreel.reel.agreed.grid import NO_GRID, PositionGrid, read_step, write_step
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.runtime.profiling import stage
from meshreel.runtime.threads import in_background, n_cores
from meshreel.sequence import Faces
from meshreel.subspace.trajectories import BoundingFrame

Numbers = npt.NDArray[Any]

POSITION_COLUMNS = 3
"""Columns of the first track: x, y and z."""


def write_field_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> Iterator[tuple[Section, bytes]]:
    """The sections of the positions in a block of `reel`, which begin the block."""
    yield Section.BLOCK, write_block(block.basis.shape[2], block.n_modes)
    yield from _write_fields(block, mesh, corrections)


def write_track_block(
    block: FieldBlock,
    mesh: FieldMesh,
    corrections: Corrections | None = None,
    *,
    n_counted: int = 0,
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a further track in a block of `reel`, padded to what its numbers ask for.

    These are numbers of so many items that are counted, where these are more than are stored.
    """
    _, n_columns, n_frames = block.basis.shape
    n_numbers = n_columns * n_frames * max(n_counted, mesh.n_verts)
    return _track_group(block.n_modes, n_numbers, _write_fields(block, mesh, corrections))


def write_exact_positions(vertices: Numbers, graph: Neighbours) -> list[tuple[Section, bytes]]:
    """The sections of a block of `lossless`: positions of shape (T_b, V, 3), in internal order."""
    return [
        (Section.BLOCK, write_block(len(vertices), 0)),
        (Section.VALUES, encode_exact(vertices, graph)),
    ]


def write_grid_positions(
    values: Numbers, step: float, graph: Neighbours
) -> list[tuple[Section, bytes]]:
    """The sections of a block of `grid`, in internal order.

    Parameters
    ----------
    values : array of shape (T_b, V, 3)
        Places of the grid; or positions that are to stay as they are.
    step : float
        Of the grid; or `NO_GRID`.
    graph : Neighbours
        Of the vertices.
    """
    return [
        (Section.BLOCK, write_block(len(values), 0)),
        (Section.VALUES, write_step(step) + encode_exact(values, graph)),
    ]


def read_grid_positions(
    payload: bytes,
    shape: tuple[int, int, int],
    dtype: np.dtype[Any],
    frame: BoundingFrame,
    graph: Neighbours,
) -> Numbers:
    """Positions of shape (T_b, V, 3), of the payload VALUES that `write_grid_positions` wrote.

    Raises
    ------
    CorruptStreamError
        If it is damaged.
    """
    step, rest = read_step(payload)
    if step == NO_GRID:
        return decode_exact(rest, shape, dtype, graph)
    numbers = decode_exact(rest, shape, np.int32, graph)
    return PositionGrid(step, frame).positions(numbers, dtype)


def write_exact_block(
    values: Numbers, graph: Neighbours, n_counted: int = 0
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a further track whose values, of shape (T_b, N, C), come back as they are.

    Padded as in `write_track_block`.
    """
    n_frames, n_items, n_columns = values.shape
    n_numbers = n_frames * max(n_counted, n_items) * n_columns
    return _track_group(0, n_numbers, [(Section.VALUES, encode_exact(values, graph))])


def read_exact_block(
    stored: StoredBlock, shape: tuple[int, int], dtype: np.dtype[Any], graph: Neighbours
) -> Numbers:
    """The values of shape (T_b, N, C) of an exact track, or positions; `shape` is (N, C)."""
    return decode_exact(stored.payload(Section.VALUES), (stored.n_frames, *shape), dtype, graph)


def write_missing(is_missing: npt.NDArray[np.bool_], graph: Neighbours) -> tuple[Section, bytes]:
    """Which values, of shape (T_b, N, C), a block does not have."""
    return Section.MISSING, encode_exact(is_missing, graph)


def read_missing(
    stored: StoredBlock, shape: tuple[int, int], graph: Neighbours
) -> npt.NDArray[np.bool_] | None:
    """Undo `write_missing`; None where a block has all its values."""
    if Section.MISSING not in stored.sections:
        return None
    payload = stored.payload(Section.MISSING)
    found = decode_exact(payload, (stored.n_frames, *shape), np.dtype(np.bool_), graph)
    return found.astype(np.bool_, copy=False)


def _track_group(
    n_modes: int, n_numbers: int, given: Iterable[tuple[Section, bytes]]
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a further track in a block, padded to what its numbers ask for."""
    sections = list(given)
    least = -(-n_numbers // MAX_NUMBERS_PER_BYTE)
    missing = least - sum(len(payload) for _, payload in sections)
    yield Section.TRACK_BLOCK, write_varint(n_modes)
    if missing > 0:
        yield Section.PADDING, bytes(missing)
    yield from sections


def _write_fields(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None
) -> Iterator[tuple[Section, bytes]]:
    """The sections that all tracks have."""
    yield Section.FIELDS, payloads.write_layout(block.layout)
    yield Section.BASIS, payloads.write_basis(block.basis)
    if corrections is not None:
        yield Section.CORRECTIONS, payloads.write_corrections(corrections)
    yield Section.COEFFICIENTS, encode_fields(block.fields, mesh.coding_order)


def read_corrections(
    stored: StoredBlock, n_verts: int, n_columns: int = POSITION_COLUMNS
) -> Corrections | None:
    """The corrections of a track in a block of `reel`, if it has some."""
    if Section.CORRECTIONS not in stored.sections:
        return None
    payload = stored.payload(Section.CORRECTIONS)
    return payloads.read_corrections(payload, n_columns, stored.n_frames, n_verts)


def read_field_block(
    stored: StoredBlock,
    faces: Faces,
    n_verts: int,
    before: FieldMesh | None,
    n_columns: int = POSITION_COLUMNS,
    n_wanted: int | None = None,
    meanwhile: Callable[[], object] | None = None,
) -> tuple[FieldBlock, FieldMesh, Future[Prepared] | None]:
    """A track in a block, the mesh of its layout, and what its weights begin with.

    Parameters
    ----------
    stored : StoredBlock
    faces, n_verts
        Of the graph.
    before : FieldMesh or None
        The mesh of the block before, which is given back where it serves.
    n_columns : int
    n_wanted : int, optional
        Only the first so many modes, unless the block refers to another.
    meanwhile : callable, optional
        Called while the hierarchy is found.

    Returns
    -------
    FieldBlock
    FieldMesh
    Future of Prepared, or None
        Begun here, where that takes long, there are cores for it, and no key block tells it.
    """
    n_modes, n_frames = stored.n_modes, stored.n_frames
    layout = payloads.read_layout(stored.payload(Section.FIELDS))
    serves = before is not None and before.stencil_size == layout.stencil_size
    field_mesh = (
        before if before is not None and serves else FieldMesh(faces, n_verts, layout.stencil_size)
    )
    order = in_background(lambda: field_mesh.coding_order)
    basis = payloads.read_basis(stored.payload(Section.BASIS), n_modes, n_columns, n_frames)
    if meanwhile is not None:
        meanwhile()
    with stage("waiting"):
        order.result()
    weights = None
    if field_mesh.is_large and not layout.reference and n_cores() > 1:
        weights = in_background(partial(prepared_weights, field_mesh.hierarchy, 0))
    coded = stored.payload(Section.COEFFICIENTS)
    n_own = n_modes - layout.n_reused
    if n_own < 0:
        raise CorruptStreamError(f"{layout.n_reused} of {n_modes} modes are reused")
    n_wanted = None if layout.reference else n_wanted
    fields = decode_fields(coded, n_own, n_verts, field_mesh.coding_order, n_wanted)
    return FieldBlock(layout, basis[: layout.n_reused + len(fields)], fields), field_mesh, weights
