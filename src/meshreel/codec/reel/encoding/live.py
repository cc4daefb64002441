"""Live encoding: the first block determines the quantization step of all.

Decoded positions of the blocks just written predict tracks.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import Sections, read_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corrections import corrections_by_frame
from meshreel.codec.open_stream import StoredBlock
from meshreel.codec.reel.encoding.block_coder import (
    FieldBlockCoder,
    FieldFrames,
    KeyedBlocks,
    checked_frames,
    coder_of,
)
from meshreel.codec.reel.encoding.effort import finest_step
from meshreel.codec.reel.encoding.smoothness import sampled_frames, step_share
from meshreel.codec.reel.encoding.target_step import step_for_target
from meshreel.codec.reel.encoding.tracks import live_track_coders
from meshreel.codec.reel.normative.blocks import (
    POSITION_COLUMNS,
    layout_of,
    read_corrections,
    read_field_block,
)
from meshreel.codec.reel.normative.fields import KeyFields, decode_basis
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.codec.track_bounds import TrackTargets
from meshreel.kernel.frames import JointFrames
from meshreel.model.extent import extent_of
from meshreel.model.tracks import Track
from meshreel.runtime.threads import chunks, in_threads, n_cores

Integers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]

MIN_FRAMES, MAX_FRAMES = 8, 256
"""Limits of the number of frames decoded per task."""

Vertices = npt.NDArray[np.floating]


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


@dataclass(frozen=True)
class FirstBlock:
    """The first block of a live sequence, a `RateModel`.

    Attributes
    ----------
    coder : FieldBlockCoder
    vertices : float array of shape (T_b, V, 3)
        In internal order.
    """

    coder: FieldBlockCoder
    vertices: Vertices

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, in model units."""
        return self.coder.frame.scale

    @property
    def own_diagonal(self) -> float:
        """Mean diagonal of single frames, in diagonals of the bounding box."""
        return extent_of(self.vertices).mean_diagonal / self.diagonal or 1.0

    @property
    def step_share(self) -> float:
        """Factor of the step of a quality, which depends on the surface."""
        frames = self.vertices[sampled_frames(len(self.vertices))]
        return step_share(self.coder.mesh.faces, self.coder.mesh.n_verts, frames)

    @property
    def rounding(self) -> float:
        """Largest rounding error of a position by its number type, in diagonals."""
        return self._frames.rounding

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""
        return self.vertices.dtype

    @property
    def finest_step(self) -> float:
        """Finest step that the stream can represent."""
        return finest_step()

    @cached_property
    def _frames(self) -> FieldFrames:
        return self.coder.frames(self.vertices)

    def size_bytes(self, step: float, bound: float) -> float:
        """Return the bytes of the block for a step, with corrections that keep a bound."""
        coded = self.coder.with_step(max(self.finest_step, step), bound).code(self._frames)
        return float(sum(len(payload) for _, payload in coded.sections))

    def measured(self, step: float) -> float:
        """Unused: `check_live` rejects targets that limit a measured quantity."""
        raise AssertionError("live encoding does not measure sizes or errors")


class LiveCoder:
    """Encodes blocks of live frames with the step of the first block.

    Parameters
    ----------
    mesh : CodedMesh
    frame : BoundingFrame
    first : float array of shape (T_b, V, 3)
        The first block, in internal order.
    tracks : dict of str to Track
        Values of the first block; relative bounds refer to their range.
    targets : mapping of str to str or float, or None
        Error bounds of tracks.

    Raises
    ------
    InvalidInputError
        If a target cannot be met.
    """

    def __init__(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        first: Vertices,
        tracks: Mapping[str, Track],
        targets: TrackTargets | None,
    ) -> None:
        self._mesh, self._dtype = mesh, first.dtype
        coder = coder_of(mesh, frame)
        self._coder = coder.with_step(*step_for_target(mesh.config, FirstBlock(coder, first)))
        self._blocks = KeyedBlocks(self._coder)

        def decoded() -> Vertices:
            coded = KeyedBlocks(self._coder).code(self._coder.frames(first))
            return self._written().positions(coded.sections)

        self._tracks = live_track_coders(mesh, tracks, targets, decoded)
        is_predicted = any(one.header.coding.is_predicted for one in self._tracks.values())
        self._decoder = self._written() if is_predicted else None

    def _written(self) -> WrittenBlocks:
        """Return a decoder of the encoded positions."""
        mesh = self._mesh
        return WrittenBlocks(self._coder.mesh, mesh.output_order, self._coder.frame, self._dtype)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """Return the sections between those of the mesh and the first block."""
        of_tracks = (track.leading_section() for track in self._tracks.values())
        return chain(of_tracks, self._coder.leading_sections())

    def code(self, vertices: Vertices, tracks: Mapping[str, Track]) -> Sections:
        """Encode the next block; positions are in internal order, tracks in the given one.

        Raises
        ------
        InvalidInputError
            If its number type, or values of a track, exceed the guaranteed bound.
        """
        sections: Sections = self._blocks.code(checked_frames(self._coder, vertices)).sections
        positions = None
        if self._decoder is not None:
            sections = list(sections)
            positions = self._decoder.positions(sections)
        others = [
            coder.code(tracks[name].values, positions) for name, coder in self._tracks.items()
        ]
        return chain(sections, *others)
