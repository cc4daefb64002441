"""Segments of a `.reel` file that are decoded when they are read."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from meshreel.codec.reel_file import ReelFile
from meshreel.codec.segmented_file import SegmentedReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.survey import FrameSurvey
from meshreel.model.sequence import Extent, Faces, Vertices, validate_finite
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackSource


def _unchanged(surface: Surface) -> Surface:
    return surface


@dataclass(frozen=True, eq=False)
class StoredSegment:
    """A `FrameSource` with the frames of a segment of a `.reel` file.

    Nothing decoded is kept here: the file keeps the last segments that were read, so that a
    sequence of many segments takes little memory.

    Parameters
    ----------
    whole : SegmentedReelFile
    number : int
        Number of the segment.
    path : Path
        Path of the file, for errors.
    fps, name, start_s
        As in `MeshSequence`.
    change : function of a surface, optional
        Returns the surface to show instead.
    """

    whole: SegmentedReelFile
    number: int
    path: Path
    fps: float
    name: str
    start_s: float
    change: Callable[[Surface], Surface] = _unchanged

    def changed(self, change: Callable[[Surface], Surface]) -> "StoredSegment":
        """Return the segment with another surface, which `change` derives from the present one."""
        before = self.change
        return replace(self, change=lambda surface: change(before(surface)))

    @property
    def _reel(self) -> ReelFile:
        return self.whole.segment(self.number)

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return self.whole.starts[self.number + 1] - self.whole.starts[self.number]

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return self._reel.n_verts

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""
        return self._reel.dtype

    @property
    def faces(self) -> Faces:
        """Vertex indices of each triangle, of shape (M, 3)."""
        with errors_naming(self.path):
            return self._reel.faces

    @property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh."""
        with errors_naming(self.path):
            return self.change(self._reel.surface)

    @property
    def tracks(self) -> dict[str, TrackSource]:
        """Tracks by name, decoded when they are read."""
        return {**self._reel.tracks}

    @property
    def is_portable(self) -> bool:
        """False: another process gets copies of the frames."""
        return False

    @property
    def files(self) -> tuple[Path, ...]:
        """The file."""
        return (self.path,)

    @cached_property
    def extent(self) -> Extent:
        """Extent of the positions; all frames are decoded on first use."""
        survey = FrameSurvey()
        for _, vertices in self.pieces(range(self.n_frames)):
            survey.add(vertices)
        return survey.extent

    def read(self, start: int, stop: int) -> Vertices:
        """Decode the positions of frames start..stop - 1, with the index rules of slices."""
        start, stop, _ = slice(start, stop).indices(self.n_frames)
        with errors_naming(self.path):
            return _finite(self._reel.read(start, max(start, stop)), start)

    def pieces(self, frames: range) -> Iterator[tuple[int, Vertices]]:
        """Yield runs of frames: number of the first, and positions of shape (T_run, V, 3)."""
        with errors_naming(self.path):
            for start, vertices in self._reel.pieces(frames):
                yield start, _finite(vertices, start)


def _finite(vertices: Vertices, first_frame: int) -> Vertices:
    """Return decoded positions; raises CorruptStreamError unless all are finite."""
    try:
        validate_finite(vertices, first_frame=first_frame)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from None
    return vertices
