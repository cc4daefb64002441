"""The blocks of a stream of `reel` to frames, track by track."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.codec.corrections import Corrections, moves_by_frame
from meshreel.codec.decoded_block import DecodedBlock
from meshreel.codec.frame_products import JointFrames
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.stored_blocks import StoredBlock, read_block, stored_track_block
from meshreel.codec.tracks import TrackHeader
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.frames import Moves
from meshreel.reel.agreed.blocks import (
    POSITION_COLUMNS,
    layout_of,
    read_corrections,
    read_exact_block,
    read_field_block,
    read_fields,
    read_missing,
)
from meshreel.reel.agreed.expected import (
    MovingSurface,
    combined,
    expected_places,
    expected_values,
    values_at,
)
from meshreel.reel.agreed.fields import (
    KeyFields,
    Layout,
    decode_basis,
    decoded_values,
)
from meshreel.reel.agreed.graphs import ItemGraph
from meshreel.reel.agreed.items import items_of
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.runtime.threads import chunks, in_background, in_threads
from meshreel.subspace.trajectories import BoundingFrame
from meshreel.surface import Domain
from meshreel.tracks import TrackKind

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]


LEAST_LENGTH = 0.5
"""A decoded normal that is shorter is that of a place that has none."""

AT_REST = 16
"""Modes whose means over a block are in the shape that few of them move."""

VALUES_AT_ONCE = 1 << 18
"""Values that are combined with what is expected of them at once."""


class ReelBlockDecoder:
    """Decodes the positions in the blocks of a stream, in any order.

    Parameters
    ----------
    opened : OpenStream
    n_modes : int or None
        Only the first so many modes of each block move, and corrections, which belong to all modes
        together, are left out. Further ones of the first `AT_REST` rest at their mean over the
        block. Weaker ones count only in blocks that refer to another; key blocks need not be read
        so far.

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
        self._n_wanted = None if n_modes is None else max(n_modes, AT_REST)
        graph = ItemGraph(opened.internal_faces, opened.n_verts)
        mesh = shared_mesh(opened, Domain.VERTEX)
        self._track = TrackReader(
            graph, lambda: opened.order, opened.stored, POSITION_COLUMNS, mesh
        )

    def block(self, number: int) -> DecodedBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored = self._opened.stored(number)
        with np.errstate(over="ignore", invalid="ignore"):
            found = self._track.modes(number, stored, self._n_wanted)
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
        Vertices, faces, corners or rows of them that have stored values, n, and columns, C.
    """

    def __init__(self, opened: OpenStream, track: int) -> None:
        self.header: TrackHeader = opened.tracks[track - 1]
        self._items = items_of(opened, self.header)
        graph, order = self._items.graph, self._items.order
        self.shape = graph.n_items, self.header.n_columns
        self._order = order
        self._mesh = FieldMesh(*graph, stencil_size=1)  # of which only the neighbours are asked for
        self._stored = partial(
            stored_track_block,
            opened.stream,
            track=track,
            shape=(self._items.most_items, self.header.n_coded),
            number_bytes=self.header.dtype.itemsize,
            limit=opened.limit,
            is_exact=self.header.is_exact,
        )
        mesh = shared_mesh(opened, self.header.stored_domain, self.header.rows)
        self._track = TrackReader(graph, lambda: order, self._stored, self.header.n_coded, mesh)
        self._opened = opened

    def block(self, number: int) -> Values:
        """Values of shape (T_b, N, C) in a block, in the order in which vertices or faces go out.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        found, spread = self._values(number), self._items.spread
        return found if spread is None else found.take(spread, axis=1)

    def _values(self, number: int) -> Values:
        """Values that are stored, of shape (T_b, n, C)."""
        stored = self._stored(number)
        if self.header.is_exact:
            return self._exact(number, stored)
        found, corrections = self._track.modes(number, stored), self._track.corrections(stored)
        moves = None if corrections is None else moves_by_frame(corrections, stored.n_frames)
        out = np.empty((stored.n_frames, *self.shape), self.header.dtype)
        with np.errstate(over="ignore", invalid="ignore"):
            if self.header.coding.is_predicted:
                self._fill_predicted(out, found, moves, self._opened.positions(number))
            else:
                found.fill(out, range(stored.n_frames), self.header.placement, moves)
                if self.header.kind is TrackKind.NORMAL:
                    out = of_unit_length(out)
        is_missing = read_missing(stored, self.shape, self._mesh.neighbours)
        if is_missing is not None:
            out[is_missing[:, self._order]] = np.nan
        return out

    def _exact(self, number: int, stored: StoredBlock) -> Values:
        header, graph = self.header, self._mesh.neighbours
        if not header.coding.is_predicted:
            return read_exact_block(stored, self.shape, header.dtype, graph)[:, self._order]
        left = np.dtype(f"i{header.dtype.itemsize}")
        found = read_exact_block(stored, self.shape, left, graph).take(self._order, axis=1)
        positions = self._opened.positions(number)

        def add(piece: slice) -> None:
            with np.errstate(over="ignore", invalid="ignore"):
                expected = expected_values(header, self._surface, positions, piece)
            found[piece] += expected_places(header, expected)

        in_threads(add, chunks(len(found), max(1, VALUES_AT_ONCE // self.shape[0])))
        return values_at(found)

    @cached_property
    def _surface(self) -> MovingSurface:
        opened = self._opened
        internal = inverse_permutation(opened.order)[opened.internal_faces].astype(np.int32)
        of_rows = self._items.vertex_of_row
        return MovingSurface(internal, opened.faces, opened.surface, of_rows)

    def _fill_predicted(
        self, out: Values, found: JointFrames, moves: Moves | None, positions: Values
    ) -> None:
        """Fill values of a block with what positions let expect, changed by what is coded."""
        header, surface = self.header, self._surface

        def fill(piece: slice) -> None:
            frames = range(piece.start, piece.stop)
            coded = np.empty((len(frames), self.shape[0], header.n_coded))
            of_piece = None if moves is None else moves.of_frames(frames)
            found.fill(coded, frames, header.placement, of_piece)
            expected = expected_values(header, surface, positions, piece)
            combined(header, expected, coded, out[piece])

        found.pack()
        in_threads(fill, chunks(len(out), max(1, VALUES_AT_ONCE // self.shape[0])))


class WrittenBlocks:
    """Decodes positions of blocks that were written one after another, as a reader will.

    Parameters
    ----------
    graph : ItemGraph
        Faces and vertices, in internal order.
    order : int64 array of shape (V,)
        Internal number of each vertex that goes out.
    frame : BoundingFrame
    dtype : numpy dtype
    """

    def __init__(
        self,
        graph: ItemGraph,
        order: Integers,
        frame: BoundingFrame,
        dtype: np.dtype[np.floating],
    ) -> None:
        self._frame, self._dtype = frame, dtype
        self._n_read = 0
        self._reader = TrackReader(
            graph, lambda: order, self._stored, POSITION_COLUMNS, SharedMesh()
        )

    def positions(self, sections: Iterable[tuple[Section, bytes]]) -> Values:
        """Positions of the next block, of shape (T_b, V, 3), as they go out."""
        own = dict(sections)
        stored = StoredBlock(0, *read_block(own[Section.BLOCK]), own)
        found = self._reader.modes(self._n_read, stored)
        self._n_read += 1
        moved = self._reader.corrections(stored)
        block = DecodedBlock(0, stored.n_frames, found, self._frame, corrections=moved)
        out = np.empty((stored.n_frames, len(found.order), POSITION_COLUMNS), self._dtype)
        block.fill(out, 0)
        return out

    def _stored(self, number: int) -> StoredBlock:
        """Never asked for: a block refers to the last key block, which the reader keeps."""
        raise AssertionError(f"block {number} is not the last key block")


@dataclass
class SharedMesh:
    """The mesh of the fields that were decoded last, for tracks that lie on the same graph."""

    mesh: FieldMesh | None = None


_SHARED: WeakKeyDictionary[OpenStream, dict[tuple[Domain, bytes], SharedMesh]] = WeakKeyDictionary()


def shared_mesh(opened: OpenStream, domain: Domain, rows: bytes = b"") -> SharedMesh:
    """The mesh of all tracks of a stream that are of its vertices, faces, corners or these rows."""
    return _SHARED.setdefault(opened, {}).setdefault((domain, rows), SharedMesh())


class TrackReader:
    """Reads a track in the blocks of a stream; the key block that others refer to is kept.

    Parameters
    ----------
    graph : ItemGraph
        That its values lie on; of the positions the internal faces and the vertices.
    order : callable
        Gives the item of the graph that each value that goes out is of, an integer array of shape
        (N,); called while the hierarchy is found.
    stored : callable
        The track in a block, by its number, as it is stored.
    n_columns : int
    shared : SharedMesh
        Of all tracks on the graph: its hierarchy is found once.
    """

    def __init__(
        self,
        graph: ItemGraph,
        order: Callable[[], Integers],
        stored: Callable[[int], StoredBlock],
        n_columns: int,
        shared: SharedMesh,
    ) -> None:
        self._graph = graph
        self._order = order
        self._stored = stored
        self._n_columns = n_columns
        self._shared = shared
        self._key: tuple[int, Layout, KeyFields] | None = None

    def modes(self, number: int, stored: StoredBlock, n_wanted: int | None = None) -> JointFrames:
        """Modes of the track in a block, whose numbers and bytes these are.

        Only the first `n_wanted`, unless the block refers to another.
        """
        layout = layout_of(stored)
        key = self._key_of(number, layout)
        mesh = self._mesh(layout)
        read = read_field_block(
            stored,
            layout,
            mesh,
            key,
            n_columns=self._n_columns,
            n_wanted=n_wanted,
            meanwhile=self._order,
        )
        coming = in_background(lambda: decode_basis(read.basis, layout, key))
        values = read.values(mesh, key)
        if key is None and values.shape[1] == stored.n_modes:
            self._key = number, layout, KeyFields(values)
        basis = coming.result()
        order = mesh.number[self._order()]
        return JointFrames(basis, values, float(layout.step), order, layout.is_single)

    def corrections(self, stored: StoredBlock) -> Corrections | None:
        """Corrections of vertices as they go out."""
        found = read_corrections(stored, self._graph.n_items, self._n_columns)
        if found is None:
            return None
        return replace(found, vertices=inverse_permutation(self._order())[found.vertices])

    def _mesh(self, layout: Layout) -> FieldMesh:
        """The mesh of a layout: that of the track that was read last, where it serves."""
        mesh = self._shared.mesh
        if mesh is None or mesh.stencil_size != layout.stencil_size:
            mesh = self._shared.mesh = FieldMesh(*self._graph, layout.stencil_size)
        return mesh

    def _key_of(self, number: int, layout: Layout) -> KeyFields | None:
        """The fields that a block refers to, decoded now or kept from before."""
        if not layout.reference:
            return None
        wanted = number - layout.reference
        if self._key is None or self._key[0] != wanted:
            if wanted < 0:
                raise CorruptStreamError(f"block {number} refers to one before the first")
            stored = self._stored(wanted)
            key_layout = layout_of(stored)
            if key_layout.reference:
                raise CorruptStreamError(
                    f"block {number} refers to block {wanted}, which refers to another itself"
                )
            mesh = self._mesh(key_layout)
            residuals, weights = read_fields(stored, key_layout, mesh)
            values = decoded_values(residuals, key_layout, mesh, weights=weights)
            self._key = wanted, key_layout, KeyFields(values)
        _, key_layout, key = self._key
        if key_layout.stencil_size != layout.stencil_size:
            raise CorruptStreamError(
                f"block {number} has stencils of {layout.stencil_size}; that which it refers to "
                f"has {key_layout.stencil_size}"
            )
        if layout.n_reused > key.values.shape[1]:
            raise CorruptStreamError(
                f"block {number} reuses {layout.n_reused} fields; that which it refers to has "
                f"{key.values.shape[1]}"
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
