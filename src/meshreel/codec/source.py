"""Input of an encoder: a mesh in internal order, and frames divided into blocks."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Vertices
from meshreel.codec.bitstream.container import (
    Header,
    Sections,
    error_bound_sections,
    payload_bytes,
    write_stream,
    write_varints,
)
from meshreel.codec.bitstream.layout import Order, Section, VertexType
from meshreel.codec.config import EncoderConfig
from meshreel.codec.connectivity.coder import CodedConnectivity, encode_mesh
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.error_bounds import total_bound
from meshreel.codec.mesh_edits import MeshEdit
from meshreel.codec.method_names import METHOD_CODES
from meshreel.codec.subspace.trajectories import BoundingFrame, stored_frame
from meshreel.codec.surface.payloads import (
    surface_in_order,
    surface_of_internal_cells,
    surface_sections,
)
from meshreel.codec.times import timing_sections
from meshreel.codec.track_bounds import TrackBound
from meshreel.codec.tracks import Coding
from meshreel.model.extent import Extent
from meshreel.model.sequence import Faces, FrameSource, MeshSequence
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.timing import UNTIMED, Timing
from meshreel.model.tracks import TrackSource, error_bound_of, max_items
from meshreel.runtime.progress import Count, Progress


@dataclass(frozen=True)
class CodedMesh:
    """A mesh with its coded connectivity and the resulting internal vertex order."""

    given_faces: Faces
    """int32 array of shape (M, 3)."""
    n_verts: int
    config: EncoderConfig
    surface: Surface = PLAIN
    """Surface of the given faces."""
    timing: Timing = UNTIMED
    """Start or times to store."""
    edit: MeshEdit | None = None
    """Edit of another mesh that results in this one; the connectivity of that mesh is then stored
    instead. It requires that the order of vertices and faces is kept.
    """
    derived: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)
    """What methods derive from the mesh, for blocks and tracks that share it."""

    @cached_property
    def _connectivity(self) -> CodedConnectivity:
        if self.edit is not None:
            return self.edit.connectivity_of(self.given_faces)
        order = self.order_kept.name.lower()
        return encode_mesh(self.given_faces, self.surface.cells, self.n_verts, order=order)

    @cached_property
    def order_kept(self) -> Order:
        """Order of vertices and faces that readers restore."""
        return self.config.order_of(self.surface)

    @property
    def faces(self) -> Faces:
        """Faces in internal order."""
        return self._connectivity.internal_faces

    @property
    def links(self) -> Faces:
        """Graph of internal vertices as triangles, of shape (n, 3): faces, or edges of cells."""
        links = self._connectivity.cell_links
        return self._connectivity.internal_faces if links is None else links

    @property
    def faces_and_twins(self) -> tuple[Faces, npt.NDArray[np.int32]]:
        """Internal faces, and the twin of each half-edge, itself at a boundary."""
        return self.faces, self._connectivity.internal_twins

    @property
    def may_be_edited(self) -> bool:
        """Whether it may be stored as an edit of another mesh."""
        return self.keeps_order and self.surface.cells is None

    @property
    def order(self) -> Integers:
        """Given number of each internal vertex."""
        return self._connectivity.internal_to_given

    @property
    def keeps_order(self) -> bool:
        """Whether decoded vertices and faces are in the given order."""
        return self.order_kept is Order.KEEP

    @property
    def keeps_vertex_order(self) -> bool:
        """Whether decoded vertices are in the given order, and not in the internal one."""
        return self.order_kept is not Order.DROP

    @cached_property
    def output_order(self) -> Integers:
        """Internal number of each decoded vertex."""
        if self.keeps_vertex_order:
            return inverse_permutation(self.order)
        return np.arange(self.n_verts)

    @property
    def output_faces(self) -> Faces:
        """Decoded faces."""
        if self.order_kept is Order.KEEP:
            return self.given_faces
        if self.order_kept is Order.DROP:
            return self.faces
        return self.order[self.faces].astype(np.int32)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """Yield the sections of connectivity or cells, order, times and surface."""
        coded = self._connectivity
        section = Section.CONNECTIVITY if coded.internal_cells is None else Section.CELLS
        yield section, write_varints(*coded.counts) + coded.payload
        if self.order_kept is not Order.DROP:
            yield Section.ORDER, self._connectivity.order_payload
        if self.edit is not None:
            yield Section.EDIT, self.edit.payload
        yield from timing_sections(self.timing)
        yield from self.surface_sections

    @cached_property
    def surface_sections(self) -> list[tuple[Section, bytes]]:
        """Sections of the surface."""
        return list(surface_sections(self.output_surface, self.output_faces, self.config.uv_bits))

    @cached_property
    def output_surface(self) -> Surface:
        """Surface of the decoded faces."""
        if self.surface.cells is not None and self.order_kept is Order.DROP:
            return self.cell_surface
        faces = self.output_faces
        return surface_in_order(self.surface, self.order_kept, self.given_faces, faces, self.order)

    @property
    def face_order(self) -> Integers:
        """Given number of each internal face."""
        return self._connectivity.given_faces(self.given_faces)

    @property
    def cell_order(self) -> Integers:
        """Given number of each internal cell."""
        assert self._connectivity.cells_to_internal is not None
        return inverse_permutation(self._connectivity.cells_to_internal)

    @cached_property
    def cell_surface(self) -> Surface:
        """Surface of internal cells, which readers return if the order is dropped."""
        cells = self._connectivity.internal_cells
        assert cells is not None
        return surface_of_internal_cells(self.surface, cells, self.order, self.cell_order)

    def header(
        self,
        frame: BoundingFrame,
        dtype: np.dtype[np.floating],
        *,
        n_frames: int,
        fps: float,
        name: str,
    ) -> Header:
        """Return the header of the stream; `n_frames` is 0 if still unknown."""
        return Header(
            n_frames=n_frames,
            n_verts=self.n_verts,
            n_faces=len(self.given_faces),
            fps=fps,
            vertex_type=VertexType(dtype.itemsize),
            method=METHOD_CODES[self.config.method],
            laplacian=self.config.laplacian_choice,
            order=self.order_kept,
            origin=frame.origin,
            scale=frame.scale,
            name=name,
        )


@dataclass(frozen=True)
class CodedTrack:
    """A track as sections of a stream."""

    leading: tuple[Section, bytes]
    """The section before the first block."""
    blocks: Sequence[list[tuple[Section, bytes]]]
    """sequence of lists of (Section, bytes). Sections of each block."""
    prediction: tuple[Coding, float] | None = None
    """Prediction from decoded positions, and its rate, if it was not tried yet."""
    values: TrackSource | None = None
    """Values of the track, if weights and predictions from positions were not tried yet."""

    @property
    def size_bytes(self) -> int:
        """Size of all payloads."""
        return payload_bytes([self.leading, *chain.from_iterable(self.blocks)])


@dataclass(frozen=True)
class Source:
    """A sequence with its encoding options."""

    sequence: FrameSource
    config: EncoderConfig
    surface: Surface | None = None
    """Part of the sequence's surface to encode. Default: all of it."""
    bounds: Mapping[str, TrackBound] = field(default_factory=dict)
    """Error bounds by track; other tracks are dropped."""
    tracks: Sequence["CodedTrack"] = ()
    """Encoded tracks, which `stream` places after the positions."""
    whole: MeshSequence | None = None
    """The sequence of several segments of which this is one; its extent sets the bounding box."""
    edit: MeshEdit | None = None
    """See `CodedMesh`."""
    origin: tuple[float, ...] | None = None
    """Origin of the coordinates in place of the center of the bounding box."""

    @property
    def extent(self) -> Extent:
        """Extent that sets the bounding box and the size of the model."""
        return (self.whole or self.sequence).extent

    @cached_property
    def mesh(self) -> CodedMesh:
        """The mesh of all frames."""
        sequence = self.sequence
        surface = sequence.surface if self.surface is None else self.surface
        config = self.config
        reorderable = {Domain.VERTEX, *([Domain.FACE] if surface.cells is None else [])}
        if any(sequence.tracks[name].domain not in reorderable for name in self.bounds):
            config = replace(config, order=config.order or "keep")
        timing = sequence.timing
        return CodedMesh(sequence.faces, sequence.n_verts, config, surface, timing, self.edit)

    def with_changes(self, **changes: Any) -> "Source":
        """Return the source with other values of some fields; its mesh is not coded again.

        The fields are those that do not affect the mesh, and options other than its order and UVs.
        """
        changed, mesh = replace(self, **changes), self.mesh
        if "config" in changes:
            mesh = copy(mesh)  # keeps the coded connectivity
            vars(mesh)["config"] = changed.config
        vars(changed)["mesh"] = mesh
        return changed

    @cached_property
    def frame(self) -> BoundingFrame:
        """Center and diagonal of the bounding box."""
        frame = stored_frame(self.extent)
        return frame if self.origin is None else replace(frame, origin=self.origin)

    @property
    def model_size(self) -> float:
        """Mean diagonal of the model in a frame, in diagonals of the bounding box."""
        return self.extent.mean_diagonal / self.frame.scale or 1.0

    @cached_property
    def n_frames(self) -> int:
        """Number of frames of the sequence."""
        return self.sequence.n_frames

    @cached_property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""
        return self.sequence.dtype

    @cached_property
    def block_frames(self) -> int:
        """Number of frames per block; the last block may have fewer."""
        n_items = self.mesh.n_verts
        if self.config.memory is not None:
            n_items = max_items(n_items, [self.sequence.tracks[name] for name in self.bounds])
        return self.config.frames_in_block(self.n_frames, n_items, self.dtype.itemsize)

    @cached_property
    def pieces(self) -> list[slice]:
        """Frames of each block."""
        starts = range(0, self.n_frames, self.block_frames)
        return [slice(start, min(start + self.block_frames, self.n_frames)) for start in starts]

    def read(self, piece: slice) -> Vertices:
        """Read the positions of a block, of shape (T_b, V, 3), in the given order."""
        return self.sequence.read(piece.start, piece.stop)

    def blocks(self) -> Iterator[Vertices]:
        """Yield positions of each block, of shape (T_b, V, 3), in internal order."""
        return (self.read(piece).take(self.mesh.order, axis=1) for piece in self.pieces)

    def stream(
        self, leading: Sections, blocks: Iterable[tuple[int, Sections]], bound: float | None = None
    ) -> bytes:
        """Return a stream of the sequence.

        Parameters
        ----------
        leading : iterable of (Section, bytes)
            Sections of the method before the first block.
        blocks : iterable of (int, sections)
            Number of frames and sections of each block.
        bound : float, optional
            Guaranteed largest error of a position relative to the source, in diagonals; 0 if they
            are lossless.
        """
        track_sections = [track.leading for track in self.tracks]
        leading = [*self.mesh.leading_sections(), *track_sections, *leading]
        if self.tracks:
            blocks = (
                (n_frames, chain(sections, *(track.blocks[number] for track in self.tracks)))
                for number, (n_frames, sections) in enumerate(blocks)
            )
        if bound is not None:
            earlier = (error_bound_of(self.sequence) or 0.0) / self.frame.scale
            leading += error_bound_sections(total_bound(100.0 * bound, 100.0 * earlier))
        return write_stream((self.header, leading, blocks))

    @cached_property
    def header(self) -> Header:
        """The header of the stream."""
        sequence = self.sequence
        return self.mesh.header(
            self.frame,
            self.dtype,
            n_frames=self.n_frames,
            fps=sequence.timing.fps,
            name=sequence.name,
        )


def reporting_frames(
    blocks: Iterable[tuple[int, Sections]], n_frames: int, progress: Progress
) -> Iterator[tuple[int, Sections]]:
    """Yield the number of frames and the sections of each block; report the encoded frames."""
    n_done = 0
    progress("encoding", Count(n_done, n_frames, "frames"))
    for n_coded, sections in blocks:
        yield n_coded, sections
        n_done += n_coded
        progress("encoding", Count(n_done, n_frames, "frames"))
