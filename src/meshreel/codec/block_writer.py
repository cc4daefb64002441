"""Encoding and writing of blocks of live frames, in segments."""

from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import Header, Sections, StreamWriter
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.codec.track_bounds import TrackTargets
from meshreel.model.tracks import Track

Vertices = npt.NDArray[np.floating]


class LiveSegment:
    """Encoder of the blocks of a segment, with positions in given order.

    Parameters
    ----------
    frame : BoundingFrame
        Origin and unit of the positions.
    first : float array of shape (T_b, V, 3)
        The first block, which determines the step; it is not encoded yet.
    tracks : dict of str to Track
        Tracks of the first block.
    targets : mapping of str to str or float, or None
        Error bounds of tracks.
    fps, name
        Of the stream.

    Attributes
    ----------
    header : Header
    leading : list of (Section, bytes)
        The sections before the first block.
    """

    def __init__(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        first: Vertices,
        tracks: dict[str, Track],
        targets: TrackTargets | None,
        fps: float,
        name: str,
    ) -> None:
        self._mesh = mesh
        internal = first.take(mesh.order, axis=1)
        self._coder = mesh.config.method_row.live_coder(mesh, frame, internal, tracks, targets)
        self.header: Header = mesh.header(frame, first.dtype, n_frames=0, fps=fps, name=name)
        self.leading: list[tuple[Section, bytes]] = [
            *mesh.leading_sections(),
            *self._coder.leading_sections(),
        ]

    def code(self, vertices: Vertices, tracks: dict[str, Track]) -> Sections:
        """Encode a block of shape (T_b, V, 3), in the given order of vertices.

        Integers are computed now, bytes when the sections are iterated.
        """
        return self._coder.code(vertices.take(self._mesh.order, axis=1), tracks)


class BlockWriter:
    """Writes blocks of live segments to a file that is open for writing."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._stream: StreamWriter | None = None
        self._segment: LiveSegment | None = None

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._stream.size_bytes if self._stream else 0

    def write(self, segment: LiveSegment, n_frames: int, sections: Sections) -> None:
        """Write a block, after the header of its segment if it is the first."""
        if self._stream is None:
            self._stream = StreamWriter(self._file, segment.header, segment.leading)
        elif segment is not self._segment:
            self._stream.begin_segment(segment.header, segment.leading)
        self._segment = segment
        self._stream.write_block(n_frames, sections)

    def finish(self) -> None:
        """Write the end of the stream, if a block was written."""
        if self._stream is not None:
            self._stream.finish()
