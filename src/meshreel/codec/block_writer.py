"""Encoding and writing of blocks of live frames."""

from itertools import chain
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import Sections, StreamWriter
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import bounding_frame
from meshreel.codec.track_bounds import TrackTargets
from meshreel.model.sequence import extent_of
from meshreel.model.tracks import Track

Vertices = npt.NDArray[np.floating]


class BlockWriter:
    """Encodes and writes blocks of positions in given order; the first sets bounding box and step.

    Parameters
    ----------
    file : binary file, open for writing
    first : float array of shape (T_b, V, 3)
        The first block, which determines bounding box and step; it is not written yet.
    tracks : dict of str to Track
        Tracks of the first block.
    targets : mapping of str to str or float, or None
        Error bounds of tracks.
    """

    def __init__(
        self,
        file: BinaryIO,
        mesh: CodedMesh,
        first: Vertices,
        tracks: dict[str, Track],
        targets: TrackTargets | None,
        fps: float,
        name: str,
    ) -> None:
        self._mesh = mesh
        frame = bounding_frame(extent_of(first))
        internal = first.take(mesh.order, axis=1)
        self._coder = mesh.config.method_row.live_coder(mesh, frame, internal, tracks, targets)
        leading = self._coder.leading_sections()
        header = mesh.header(frame, first.dtype, n_frames=0, fps=fps, name=name)
        self._writer = StreamWriter(file, header, chain(mesh.leading_sections(), leading))

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._writer.size_bytes

    def analyze(self, vertices: Vertices, tracks: dict[str, Track]) -> Sections:
        """Encode a block of shape (T_b, V, 3), in the given order of vertices.

        Integers are computed now, bytes when the sections are iterated.
        """
        return self._coder.code(vertices.take(self._mesh.order, axis=1), tracks)

    def write(self, n_frames: int, sections: Sections) -> None:
        """Write a block."""
        self._writer.write_block(n_frames, sections)

    def finish(self) -> None:
        """Write the end of the stream."""
        self._writer.finish()
