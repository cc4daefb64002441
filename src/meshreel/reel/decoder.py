"""The blocks of a stream of `reel` to frames, track by track."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections, moves_by_frame
from meshreel.codec.decoded_block import DecodedBlock
from meshreel.codec.frame_products import JointFrames
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.stored_blocks import StoredBlock, stored_track_block
from meshreel.codec.tracks import TrackHeader
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.reel.agreed.blocks import (
    POSITION_COLUMNS,
    read_corrections,
    read_exact_block,
    read_field_block,
    read_missing,
)
from meshreel.reel.agreed.fields import (
    FieldBlock,
    KeyFields,
    Layout,
    decode_basis,
    decode_fields,
)
from meshreel.reel.agreed.graphs import ItemGraph, item_graph
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.surface import Domain
from meshreel.tracks import TrackKind

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]


LEAST_LENGTH = 0.5
"""A decoded normal that is shorter is that of a place that has none."""


class ReelBlockDecoder:
    """Decodes the positions in the blocks of a stream, in any order.

    Parameters
    ----------
    opened : OpenStream
    n_modes : int or None
        Only the first so many modes of each block move; the others rest at their mean over the
        block, and corrections, which belong to all modes together, are left out.

    Raises
    ------
    InvalidInputError
        If `n_modes` is below 1.
    """

    def __init__(self, opened: OpenStream, n_modes: int | None) -> None:
        if n_modes is not None and not (1 <= n_modes < float("inf") and int(n_modes) == n_modes):
            raise InvalidInputError(f"n_modes must be a whole number of at least 1; got {n_modes}")
        self._opened = opened
        self._n_modes = n_modes
        graph = ItemGraph(opened.internal_faces, opened.n_verts)
        self._track = _TrackReader(graph, opened.order, opened.stored, POSITION_COLUMNS)

    def block(self, number: int) -> DecodedBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored = self._opened.stored(number)
        with np.errstate(over="ignore", invalid="ignore"):
            found = self._track.modes(number, stored)
        if self._n_modes is not None:
            found = replace(found, basis=resting_after(found.basis, self._n_modes))
        return DecodedBlock(
            start=stored.start,
            n_frames=stored.n_frames,
            frames_of=found,
            frame=self._opened.frame,
            corrections=None if self._n_modes is not None else self._track.corrections(stored),
        )


class TrackDecoder:
    """Decodes a further track in the blocks of a stream, in any order.

    Parameters
    ----------
    opened : OpenStream
    track : int
        From 1 on.

    Attributes
    ----------
    header : TrackHeader
    shape : tuple of 2 ints
        Vertices, faces or corners that have values, N, and columns, C.
    """

    def __init__(self, opened: OpenStream, track: int) -> None:
        self.header: TrackHeader = opened.tracks[track - 1]
        graph, order = ItemGraph(opened.internal_faces, opened.n_verts), opened.order
        if self.header.domain is not Domain.VERTEX:
            graph = item_graph(self.header.domain, opened.faces, opened.surface, opened.n_verts)
            order = np.arange(graph.n_items)
        self.shape = graph.n_items, self.header.n_columns
        self._order = order
        self._mesh = FieldMesh(*graph, stencil_size=1)  # of which only the neighbours are asked for
        self._stored = partial(
            stored_track_block,
            opened.stream,
            track=track,
            shape=self.shape,
            is_exact=self.header.is_exact,
        )
        self._track = _TrackReader(graph, order, self._stored, self.header.n_columns)

    def block(self, number: int) -> Values:
        """Values of shape (T_b, N, C) in a block, in the order in which vertices or faces go out.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored = self._stored(number)
        if self.header.is_exact:
            dtype, graph = self.header.dtype, self._mesh.neighbours
            return read_exact_block(stored, self.shape, dtype, graph)[:, self._order]
        found, corrections = self._track.modes(number, stored), self._track.corrections(stored)
        moves = None if corrections is None else moves_by_frame(corrections, stored.n_frames)
        out = np.empty((stored.n_frames, *self.shape), self.header.dtype)
        with np.errstate(over="ignore", invalid="ignore"):
            found.fill(out, range(stored.n_frames), self.header.placement, moves)
            if self.header.kind is TrackKind.NORMAL:
                out = of_unit_length(out)
        is_missing = read_missing(stored, self.shape, self._mesh.neighbours)
        if is_missing is not None:
            out[is_missing[:, self._order]] = np.nan
        return out


class _TrackReader:
    """Reads a track in the blocks of a stream; the key block that others refer to is kept.

    Parameters
    ----------
    graph : ItemGraph
        That its values lie on; of the positions the internal faces and the vertices.
    order : integer array of shape (N,)
        The item of the graph that each value that goes out is of.
    stored : callable
        The track in a block, by its number, as it is stored.
    n_columns : int
    """

    def __init__(
        self,
        graph: ItemGraph,
        order: Integers,
        stored: Callable[[int], StoredBlock],
        n_columns: int,
    ) -> None:
        self._graph = graph
        self._order = order
        self._stored = stored
        self._n_columns = n_columns
        self._field_mesh: FieldMesh | None = None
        self._key: tuple[int, Layout, KeyFields] | None = None

    def modes(self, number: int, stored: StoredBlock) -> JointFrames:
        """Modes of the track in a block, whose numbers and bytes these are."""
        block, mesh = self._read(stored)
        key = self._key_of(number, block.layout)
        basis = decode_basis(block.basis)
        values = decode_fields(block, mesh, key)
        if key is None:
            self._key = number, block.layout, KeyFields(values)
        layout, order = block.layout, mesh.number[self._order]
        return JointFrames(basis, values, float(layout.step), order, layout.is_single)

    def corrections(self, stored: StoredBlock) -> Corrections | None:
        """Corrections of vertices as they go out."""
        found = read_corrections(stored, self._graph.n_items, self._n_columns)
        if found is None:
            return None
        return replace(found, vertices=inverse_permutation(self._order)[found.vertices])

    def _read(self, stored: StoredBlock) -> tuple[FieldBlock, FieldMesh]:
        block, mesh = read_field_block(stored, *self._graph, self._field_mesh, self._n_columns)
        self._field_mesh = mesh
        return block, mesh

    def _key_of(self, number: int, layout: Layout) -> KeyFields | None:
        """The fields that a block refers to, decoded now or kept from before."""
        if not layout.reference:
            return None
        wanted = number - layout.reference
        if self._key is None or self._key[0] != wanted:
            if wanted < 0:
                raise CorruptStreamError(f"block {number} refers to one before the first")
            block, mesh = self._read(self._stored(wanted))
            if block.layout.reference:
                raise CorruptStreamError(
                    f"block {number} refers to block {wanted}, which refers to another itself"
                )
            self._key = wanted, block.layout, KeyFields(decode_fields(block, mesh))
        _, key_layout, key = self._key
        if key_layout.stencil_size != layout.stencil_size:
            raise CorruptStreamError(
                f"block {number} has stencils of {layout.stencil_size}; that which it refers to "
                f"has {key_layout.stencil_size}"
            )
        return key


def of_unit_length(normals: Values) -> Values:
    """Normals of shape (..., 3) divided by their length; 0 where that is below a half."""
    x, y, z = np.moveaxis(normals.astype(np.float64), -1, 0)
    lengths = np.sqrt((x * x + y * y) + z * z)
    is_there = (lengths >= LEAST_LENGTH)[..., None]
    found = np.zeros(normals.shape)
    np.divide(normals, lengths[..., None], out=found, where=is_there)
    return found.astype(normals.dtype)


def resting_after(basis: Floats, n_modes: int) -> Floats:
    """Temporal basis of shape (3, T, K), of which vectors behind the first stay at their mean.

    Few modes so begin with the mean shape of the block, and not with nothing.
    """
    means = basis[:, :, n_modes:].mean(axis=1, keepdims=True)
    rest = np.broadcast_to(means, basis[:, :, n_modes:].shape)
    return np.concatenate([basis[:, :, :n_modes], rest], axis=2)
