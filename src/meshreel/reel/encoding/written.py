"""The blocks of a stream of `reel` to frames, track by track."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.decoded_block import DecodedBlock
from meshreel.codec.frame_products import JointFrames
from meshreel.codec.stored_blocks import StoredBlock, read_block
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.errors import CorruptStreamError
from meshreel.reel.agreed.blocks import (
    POSITION_COLUMNS,
    layout_of,
    read_corrections,
    read_field_block,
    read_fields,
)
from meshreel.reel.agreed.fields import (
    KeyFields,
    Layout,
    decode_basis,
    decoded_values,
)
from meshreel.reel.agreed.graphs import ItemGraph
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.runtime.threads import in_background
from meshreel.subspace.trajectories import BoundingFrame

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]


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
