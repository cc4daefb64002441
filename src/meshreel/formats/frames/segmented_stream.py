"""Frames streamed to a writer in segments, each of constant connectivity."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.model.frame_choice import start_of
from meshreel.model.sequence import Faces, FrameSource, Vertices
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackPart, TrackSource
from meshreel.runtime.progress import Count, Progress, silent

if TYPE_CHECKING:
    from meshreel.codec.reel_file import ReelFile

Tracks = Mapping[str, TrackSource]

MAX_KEPT_BYTES = 1 << 26
"""Faces and surfaces up to this size are decoded once, though writers go over them several times;
positions and tracks are always read again."""


@dataclass(frozen=True)
class StreamedSegment:
    """Consecutive frames of a source of constant connectivity.

    Parameters
    ----------
    open : function
        Returns the source; may be called several times. A `FrameStream` is the only segment.
    frames : range
        Frame numbers in the source.
    """

    open: "Callable[[], FrameSource | ReelFile | FrameStream]"
    frames: range


@dataclass(frozen=True, eq=False)
class SegmentMesh:
    """The mesh of a segment without its positions.

    Attributes
    ----------
    n_frames, n_verts : int
    faces : int32 array of shape (M, 3)
    dtype : dtype
        Type of the positions.
    surface : Surface
    tracks : dict of str to TrackSource
        Those that the format supports.
    """

    n_frames: int
    n_verts: int
    faces: Faces
    dtype: np.dtype[np.floating]
    surface: Surface
    tracks: Tracks


class _KeptMeshes:
    """Faces and surfaces of the first segments, up to `MAX_KEPT_BYTES`."""

    def __init__(self) -> None:
        self._found: dict[StreamedSegment, tuple[Faces, Surface]] = {}
        self._size_bytes = 0

    def of(self, segment: StreamedSegment, source: Any) -> tuple[Faces, Surface]:
        """Return the faces and the surface of a segment, given its source."""
        if segment in self._found:
            return self._found[segment]
        faces, surface = source.faces, source.surface
        size_bytes = faces.nbytes + surface.size_bytes
        if self._size_bytes + size_bytes <= MAX_KEPT_BYTES:
            self._found[segment] = faces, surface
            self._size_bytes += size_bytes
        return faces, surface


def _all_tracks(tracks: Tracks, notes: list[str]) -> Tracks:
    return tracks


def _unchanged(mesh: SegmentMesh) -> SegmentMesh:
    return mesh


class SegmentedStream:
    """A sequence in segments, whose positions are read in order, one segment at a time.

    Parameters
    ----------
    segments : sequence of StreamedSegment
        At least one.
    fps, name, start_s
        As in `MeshSequence`.
    progress : Progress, default silent
        Called after every frame.
    notes : list of str, optional
        Receives a sentence for each thing that a format cannot store exactly.
    supported_tracks : function of tracks and a list of notes, optional
        Returns the tracks to write; the notes list the others. Default: all.

    Attributes
    ----------
    n_frames, n_segments : int
    starts : tuple of int
        First frame of each segment, and the number of all frames.
    wants_notes, data_files, image_folder
        As of `FrameStream`.
    """

    def __init__(
        self,
        segments: Sequence[StreamedSegment],
        *,
        fps: float = 0.0,
        name: str = "",
        start_s: float = 0.0,
        progress: Progress = silent,
        notes: list[str] | None = None,
        supported_tracks: Callable[[Tracks, list[str]], Tracks] = _all_tracks,
    ) -> None:
        self._segments = tuple(segments)
        self.fps: float = fps
        self.name: str = name
        self.start_s: float = start_s
        self.starts: tuple[int, ...] = (0, *accumulate(len(one.frames) for one in self._segments))
        self.n_segments: int = len(self._segments)
        self.n_frames: int = self.starts[-1]
        self.progress = progress
        self.wants_notes: bool = notes is not None
        self.notes: list[str] = notes if notes is not None else []
        self.image_folder = ""
        self.data_files: list[tuple[str, Path]] = []
        self._supported_tracks = supported_tracks
        self._change: Callable[[SegmentMesh], SegmentMesh] = _unchanged
        self._kept = _KeptMeshes()

    @classmethod
    def of(cls, stream: FrameStream) -> "SegmentedStream":
        """Return a stream of one segment."""
        whole = StreamedSegment(lambda: stream, range(stream.n_frames))
        return cls(
            [whole],
            fps=stream.fps,
            name=stream.name,
            start_s=stream.start_s,
            progress=stream.progress,
            notes=stream.notes if stream.wants_notes else None,
        )

    def changed(self, change: Callable[[SegmentMesh], SegmentMesh]) -> "SegmentedStream":
        """Return the stream with another surface and other tracks in each segment."""
        changed, before = copy(self), self._change
        changed._change = lambda mesh: change(before(mesh))
        return changed

    def quiet(self) -> "SegmentedStream":
        """Return the stream without progress and notes, to read it twice."""
        quiet = copy(self)
        quiet.progress, quiet.notes = silent, []
        return quiet

    def meshes(self) -> Iterator[SegmentMesh]:
        """Yield the mesh of each segment in order, before or after `segments`."""
        for segment in self._segments:
            yield self._mesh(segment, [])

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type that holds the positions of all segments."""
        return np.result_type(*(segment.open().dtype for segment in self._segments))

    def frames(self) -> Iterator[Vertices]:
        """Yield the positions of all frames of several segments, without decoding surfaces."""
        for segment in self._segments:
            for block in _blocks(segment.open(), segment.frames):
                yield from block

    def segments(self) -> Iterator[FrameStream]:
        """Yield the frames of each segment in order; read them before the next one."""
        for number in range(self.n_segments):
            yield (stream := self._stream(number))
            if stream.notes is not self.notes:
                self.notes.extend(one for one in stream.notes if one not in self.notes)

    def time_of(self, frame: int, assumed_fps: float) -> float:
        """Return the time of a frame in seconds, at a frame rate to assume if it is unknown."""
        return self.start_s + frame / (self.fps or assumed_fps)

    def _mesh(self, segment: StreamedSegment, notes: list[str]) -> SegmentMesh:
        source, frames = segment.open(), segment.frames
        tracks = {
            name: track if len(frames) == track.shape[0] else TrackPart(track, frames)
            for name, track in self._supported_tracks(source.tracks, notes).items()
        }
        faces, surface = self._kept.of(segment, source)
        mesh = SegmentMesh(len(frames), source.n_verts, faces, source.dtype, surface, tracks)
        return self._change(mesh)

    def _stream(self, number: int) -> FrameStream:
        segment, first = self._segments[number], self.starts[number]
        source = segment.open()
        if isinstance(source, FrameStream):
            mesh = self._mesh(segment, [])
            source.surface, source.tracks = mesh.surface, dict(mesh.tracks)
            source.image_folder, source.data_files = self.image_folder, self.data_files
            return source
        own_notes: list[str] = []
        notes = self.notes if self.n_segments == 1 else own_notes
        mesh = self._mesh(segment, notes)
        stream = FrameStream(
            _blocks(source, segment.frames),
            mesh.faces,
            n_frames=mesh.n_frames,
            fps=self.fps,
            name=self.name,
            start_s=start_of(range(first, first + 1), self.start_s, self.fps),
            surface=mesh.surface,
            progress=self._progress_from(first),
            notes=notes,
            tracks=mesh.tracks,
        )
        stream.wants_notes = self.wants_notes
        stream.image_folder, stream.data_files = self.image_folder, self.data_files
        return stream

    def _progress_from(self, first: int) -> Progress:
        """Return a function that counts frames of a segment as frames of the sequence."""

        def report(stage: str, share: float) -> None:
            if isinstance(share, Count) and share.unit == "frames":
                share = Count(first + share.done, self.n_frames, share.unit)
            self.progress(stage, share)

        return report


def _blocks(source: Any, frames: range) -> Iterator[Vertices]:
    """Yield the positions of consecutive frames, in as large blocks as the source decodes."""
    if hasattr(source, "pieces"):
        yield from (block for _, block in source.pieces(frames))
    else:
        yield from (source.read(index, index + 1) for index in frames)
