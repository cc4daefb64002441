"""Frames that lie in a file as one array: loaded, or read when they are asked for."""

import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import StoredFrames, changed_error
from meshreel.formats.frames.survey import FrameSurvey
from meshreel.formats.options import ReadOptions
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices, validate_finite
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource, copied, size_bytes

BLOCK_BYTES = 1 << 24  # of positions that are read together


@dataclass(frozen=True, eq=False)
class Description:
    """Everything of a sequence but its positions, as in `MeshSequence`."""

    faces: Faces
    fps: float
    name: str
    start_s: float = 0.0
    surface: Surface = PLAIN


@dataclass(frozen=True, eq=False)
class ArrayFrames:
    """Positions of shape (T, V, 3) in a file, which is known to be large enough for them.

    Parameters
    ----------
    n_frames, n_verts : int
        At least 1.
    dtype : float32 or float64
        Of what `read` gives.
    read : function of a start and a stop
        Gives the positions of frames start..stop - 1; its errors name the file.
    """

    path: Path
    n_frames: int
    n_verts: int
    dtype: np.dtype[np.floating]
    read: Callable[[int, int], Vertices]
    _checksums: dict[int, int] = field(default_factory=dict)

    def opened(
        self, about: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> FrameSource:
        """The sequence, loaded if the options say so; all positions are read once now.

        Raises
        ------
        InvalidInputError
            Naming the file, if a position is not finite or the description does not fit; when
            frames are read later too, if the file has changed meanwhile.
        """
        size = self.n_frames * self.n_verts * 3 * self.dtype.itemsize
        size += sum(map(size_bytes, tracks.values()))
        most = options.max_loaded_bytes
        with errors_naming(self.path):
            if most is None or size <= most:
                return self._loaded(about, options, tracks)
            return self._stored(about, options, tracks)

    def _loaded(
        self, about: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> MeshSequence:
        vertices: Vertices = np.empty((self.n_frames, self.n_verts, 3), self.dtype)
        for start, block in self._blocks(options):
            vertices[start : start + len(block)] = block
        return MeshSequence(
            vertices,
            about.faces,
            about.fps,
            about.name,
            about.start_s,
            about.surface,
            {name: copied(one, range(self.n_frames)) for name, one in tracks.items()},
        )

    def _stored(
        self, about: Description, options: ReadOptions, tracks: Mapping[str, TrackSource]
    ) -> StoredFrames:
        survey = FrameSurvey()
        for start, block in self._blocks(options):
            survey.add(block)
            self._checksums.update(enumerate(map(checksum, block), start))
        return StoredFrames(
            n_frames=self.n_frames,
            n_verts=self.n_verts,
            faces=about.faces,
            fps=about.fps,
            name=about.name,
            dtype=self.dtype,
            extent=survey.extent,
            read_range=self._read_unchanged,
            start_s=about.start_s,
            surface=about.surface,
            files=(self.path,),
            tracks=tracks,
        )

    def _blocks(self, options: ReadOptions) -> Iterator[tuple[int, Vertices]]:
        """Some frames at a time, known to be finite, with the number of the first."""
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
    """A number that tells whether the numbers of a frame are those that were read before."""
    return zlib.crc32(np.ascontiguousarray(frame).data)
