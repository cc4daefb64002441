"""Positions stored as one array in a file: loaded, or read on demand."""

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames, changed_error
from meshreel.formats.options import ReadOptions
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource, read_track, size_bytes
from meshreel.model.validation import validate_finite

BLOCK_BYTES = 1 << 24  # positions read at a time


@dataclass(frozen=True, eq=False)
class Description:
    """A sequence without its positions: faces, times, name and surface, as in `MeshSequence`."""

    faces: Faces
    fps: float
    name: str
    start_s: float = 0.0
    surface: Surface = PLAIN


@dataclass(frozen=True, eq=False)
class ArrayFrames:
    """Positions of shape (T, V, 3) in a file whose size was already checked.

    Parameters
    ----------
    n_frames, n_verts : int
        At least 1.
    dtype : float32 or float64
        Type of the positions that `read` returns.
    read : function of a start and a stop
        Reads the positions of frames start..stop - 1; its errors name the file.
    """

    path: Path
    n_frames: int
    n_verts: int
    dtype: np.dtype[np.floating]
    read: Callable[[int, int], Vertices]
    _checksums: dict[int, int] = field(default_factory=dict)

    def open(
        self, description: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> FrameSource:
        """Return the sequence, loaded if it is within `max_loaded_bytes`.

        All positions are read and validated once now.

        Raises
        ------
        InvalidInputError
            If a position is not finite or the description does not fit; also when frames are read
            later, if the file has changed. The error names the file.
        """
        size = self.n_frames * self.n_verts * 3 * self.dtype.itemsize
        size += sum(map(size_bytes, tracks.values()))
        max_bytes = options.max_loaded_bytes
        with errors_naming(self.path):
            if max_bytes is None or size <= max_bytes:
                return self._loaded(description, options, tracks)
            return self._stored(description, options, tracks)

    def _loaded(
        self, description: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> MeshSequence:
        vertices: Vertices = np.empty((self.n_frames, self.n_verts, 3), self.dtype)
        for start, block in self._blocks(options):
            vertices[start : start + len(block)] = block
        return MeshSequence(
            vertices,
            description.faces,
            description.fps,
            description.name,
            description.start_s,
            description.surface,
            {name: read_track(one, range(self.n_frames)) for name, one in tracks.items()},
        )

    def _stored(
        self, description: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> StoredFrames:
        survey = FrameSurvey()
        for start, block in self._blocks(options):
            survey.add(block)
            self._checksums.update(enumerate(map(checksum, block), start))
        return StoredFrames(
            n_frames=self.n_frames,
            n_verts=self.n_verts,
            faces=description.faces,
            fps=description.fps,
            name=description.name,
            dtype=self.dtype,
            extent=survey.extent,
            read_range=self._read_unchanged,
            start_s=description.start_s,
            surface=description.surface,
            files=(self.path,),
            tracks=tracks,
        )

    def _blocks(self, options: ReadOptions) -> Iterator[tuple[int, Vertices]]:
        """Yield validated blocks of frames with the number of their first frame."""
        n_at_once = max(1, BLOCK_BYTES // (self.n_verts * 3 * self.dtype.itemsize))
        for start in range(0, self.n_frames, n_at_once):
            block = self.read(start, min(start + n_at_once, self.n_frames))
            validate_finite(block, first_frame=start)
            yield start, block
            options.progress("reading", (start + len(block)) / self.n_frames)

    def _read_unchanged(self, start: int, stop: int) -> Vertices:
        block = self.read(start, stop)
        for index, frame in enumerate(block, start):
            if checksum(frame) != self._checksums[index]:
                raise changed_error(f"{self.path} (frame {index})")
        return block


def checksum(frame: npt.NDArray[Any]) -> int:
    """Return a checksum that detects whether a frame changes between reads."""
    return zlib.crc32(np.ascontiguousarray(frame).data)
