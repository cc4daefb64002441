"""Positions of blocks as a reader will decode them, for tracks that follow from these."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corrections import corrections_by_frame
from meshreel.codec.reel.normative.blocks import (
    POSITION_COLUMNS,
    layout_of,
    read_corrections,
    read_field_block,
)
from meshreel.codec.reel.normative.fields import KeyFields, decode_basis
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.kernel.frames import JointFrames
from meshreel.runtime.threads import chunks, in_threads, n_cores

Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]

LEAST_FRAMES, MOST_FRAMES = 8, 256
"""Frames that the core computes at a time."""


class WrittenBlocks:
    """Decodes the positions of blocks in the order in which they are written.

    Parameters
    ----------
    mesh : FieldMesh
        Of the coder of the blocks, in internal order.
    order : int64 array of shape (V,)
        Internal number of each output vertex.
    frame : BoundingFrame
    dtype : numpy dtype
    """

    def __init__(
        self,
        mesh: FieldMesh,
        order: Integers,
        frame: BoundingFrame,
        dtype: np.dtype[np.floating],
    ) -> None:
        self._mesh, self._order, self._frame, self._dtype = mesh, order, frame, dtype
        self._key: KeyFields | None = None

    def positions(self, sections: Iterable[tuple[Section, bytes]]) -> Values:
        """Positions of the next block, of shape (T_b, V, 3), in output order."""
        own, mesh = dict(sections), self._mesh
        stored = StoredBlock(0, *read_block_counts(own[Section.BLOCK]), own)
        layout = layout_of(stored)
        key = self._key if layout.reference else None  # the coder refers to the last key block
        read = read_field_block(stored, layout, mesh, key)
        values = read.values(mesh, key)
        if key is None:
            self._key = KeyFields(values)
        basis = decode_basis(read.basis, layout, key)
        order = mesh.number[self._order]
        found = JointFrames(basis, values, float(layout.step), order, layout.is_single)
        return self._filled(found, stored)

    def _filled(self, found: JointFrames, stored: StoredBlock) -> Values:
        n_frames, moves = stored.n_frames, None
        corrections = read_corrections(stored, self._mesh.n_verts)
        if corrections is not None:
            moves = corrections_by_frame(corrections, n_frames, inverse_permutation(self._order))
        out = np.empty((n_frames, len(self._order), POSITION_COLUMNS), self._dtype)
        found.pack()

        def fill(piece: slice) -> None:
            frames = range(piece.start, piece.stop)
            own = None if moves is None else moves.of_frames(frames)
            found.fill(out[piece], frames, self._frame.placement, own)

        n_together = max(LEAST_FRAMES, min(-(-n_frames // n_cores()), MOST_FRAMES))
        in_threads(fill, chunks(n_frames, n_together))
        return out
