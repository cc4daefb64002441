"""Decoded positions of blocks just written, which predict tracks."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corrections import corrections_by_frame
from meshreel.codec.open_stream import StoredBlock
from meshreel.codec.reel.normative.blocks import (
    POSITION_COLUMNS,
    layout_of,
    read_corrections,
    read_field_block,
)
from meshreel.codec.reel.normative.fields import KeyFields, decode_basis
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.kernel.frames import JointFrames
from meshreel.runtime.threads import chunks, in_threads, n_cores

Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]

MIN_FRAMES, MAX_FRAMES = 8, 256
"""Limits of the number of frames decoded per task."""


class WrittenBlocks:
    """Decodes the positions of blocks in the order of writing.

    Parameters
    ----------
    mesh : FieldMesh
        Mesh of the block coder, in internal order.
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
        by_section, mesh = dict(sections), self._mesh
        stored = StoredBlock(0, *read_block_counts(by_section[Section.BLOCK]), by_section)
        layout = layout_of(stored)
        key = self._key if layout.reference else None  # the encoder refers to the last key block
        read = read_field_block(stored, layout, mesh, key)
        values = read.values(mesh, key)
        if key is None:
            self._key = KeyFields(values)
        basis = decode_basis(read.basis, layout, key)
        order = mesh.number[self._order]
        frames = JointFrames(basis, values, float(layout.step), order, layout.is_single)
        return self._corrected(frames, stored)

    def _corrected(self, joint: JointFrames, stored: StoredBlock) -> Values:
        n_frames, offsets = stored.n_frames, None
        corrections = read_corrections(stored, self._mesh.n_verts)
        if corrections is not None:
            offsets = corrections_by_frame(corrections, n_frames, inverse_permutation(self._order))
        out = np.empty((n_frames, len(self._order), POSITION_COLUMNS), self._dtype)
        joint.pack()

        def fill(piece: slice) -> None:
            frames = range(piece.start, piece.stop)
            here = None if offsets is None else offsets.of_frames(frames)
            joint.fill(out[piece], frames, self._frame.placement, here)

        n_together = max(MIN_FRAMES, min(-(-n_frames // n_cores()), MAX_FRAMES))
        in_threads(fill, chunks(n_frames, n_together))
        return out
