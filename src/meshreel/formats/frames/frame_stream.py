"""The frames of a sequence as writers receive them, in segments of constant connectivity."""

from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from meshreel.arrays import Values
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces, MeshSequence, Vertices, frames_by_segment
from meshreel.model.surface import Surface
from meshreel.model.timing import Timing
from meshreel.model.tracks import TrackPart, TrackSource, error_bound_of, track_like
from meshreel.model.validation import validate_finite, validate_vertices
from meshreel.runtime.progress import Count, Progress, silent

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource, WriteOptions
    from meshreel.formats.rigs import FittedRig

Tracks = Mapping[str, TrackSource]

MAX_CACHED_BYTES = 1 << 26
"""Size up to which faces and surfaces are cached, since writers make several passes over them;
positions and tracks are read in each pass."""


@dataclass(frozen=True, eq=False)
class FrameStream:
    """Consecutive frames with the same faces; positions and values are read on demand."""

    source: Any
    """A segment of the sequence."""
    frame_numbers: range
    """Frames of the segment."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    surface: Surface
    tracks: Tracks
    """Tracks that the format supports."""
    name: str
    timing: Timing
    """As in `MeshSequence`."""
    progress: Progress
    """Called after every frame."""
    notes: Notes
    """Receives a sentence for each thing that a format cannot store exactly."""

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return len(self.frame_numbers)

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return int(self.source.n_verts)

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Type of all positions."""
        dtype: np.dtype[np.floating] = self.source.dtype
        return dtype

    @cached_property
    def first(self) -> Vertices:
        """Positions of the first frame, of shape (V, 3)."""
        first: Vertices = next(_blocks(self.source, self.frame_numbers[:1]))[0]
        return first

    def frames(self) -> Iterator[Vertices]:
        """Yield the positions of each frame, of shape (V, 3).

        Raises
        ------
        InvalidInputError
            If a position is not finite.
        """
        index = 0
        for block in _blocks(self.source, self.frame_numbers):
            validate_finite(block, first_frame=index)
            for frame in block:
                yield frame
                index += 1
                self.progress("writing", Count(index, self.n_frames, "frames"))

    def values(self, index: int) -> dict[str, Values]:
        """Read the values of each track in a frame, of shape (N, C)."""
        return {name: track.read(index, index + 1)[0] for name, track in self.tracks.items()}

    def gather(self) -> MeshSequence:
        """Load all frames into memory."""
        vertices = self.source.read(self.frame_numbers.start, self.frame_numbers.stop)
        tracks = {
            name: track_like(track, track.read(0, self.n_frames))
            for name, track in self.tracks.items()
        }
        vertices = validate_vertices(vertices)
        return MeshSequence.of_finite(
            vertices,
            self.faces,
            self.name,
            self.timing,
            self.surface,
            tracks,
            error_bound_of(self.source),
        )


class RigFit(Protocol):
    """Fits a rig to a stream, which takes long."""

    def __call__(
        self, stream: "SegmentedStream", options: "WriteOptions", max_bones: int | None, /
    ) -> "FittedRig | None":
        """Return a rig within the error bounds of the options, and report its errors.

        Parameters
        ----------
        max_bones : int or None
            To return None if a rig needs more bones, or probably cannot meet the bounds; None to
            use the bones of the options, and to raise an error.
        """


class SegmentedStream:
    """A range of frames of a sequence, read in order, a segment at a time.

    Parameters
    ----------
    selection : range, optional
        Consecutive frame numbers; the times are adjusted. Default: all.
    progress : Progress, default silent
        Called after every frame.
    notes : Notes, optional
        Receives a sentence for each thing that a format cannot store exactly.

    Attributes
    ----------
    starts : tuple of int
        First frame of each segment, and the number of all frames.
    name, timing
        As in `MeshSequence`.
    wants_notes : bool
        Whether the caller of the writer reads the notes.
    image_folder : str
        Name of the folder next to the file for the images of the surface, whose file names are
        those of `meshreel.formats.surfaces.images.image_names`; empty if there is none.
    data_files : list of tuple of str and Path
        Further files that the file refers to: name in the file, and path to write.
    rig : FittedRig, or None
        To write in place of the frames.
    fit_rig : callable, or None
        For writers that choose between a rig and frames; see `RigFit`.
    figures : dict of str to any, or None
        Receives figures of the written file, such as errors; if None, the notes receive them as
        sentences.
    """

    def __init__(
        self,
        sequence: "AnySource",
        selection: range | None = None,
        *,
        progress: Progress = silent,
        notes: Notes | None = None,
        figures: dict[str, Any] | None = None,
    ) -> None:
        selection = range(sequence.n_frames) if selection is None else selection
        self._sequence: Any = sequence
        self._segment_frames = tuple(frames_by_segment(self._sequence.starts, selection))
        sizes = (len(frames) for _, frames in self._segment_frames)
        self.starts: tuple[int, ...] = (0, *accumulate(sizes))
        self.name: str = sequence.name
        self.timing: Timing = sequence.timing.part(selection)
        self.n_segments: int = len(self._segment_frames)
        self.n_frames: int = len(selection)
        self.progress = progress
        self.wants_notes: bool = notes is not None
        self.notes: Notes = notes if notes is not None else Notes()
        self.image_folder = ""
        self.data_files: list[tuple[str, Path]] = []
        self.rig: FittedRig | None = None
        self.fit_rig: RigFit | None = None
        self.figures = figures
        self._change: Callable[[FrameStream], FrameStream] = lambda segment: segment
        self._cached_meshes: dict[int, tuple[Faces, Surface]] = {}
        self._cached_bytes = 0

    def map_segments(self, change: Callable[[FrameStream], FrameStream]) -> "SegmentedStream":
        """Return the stream with `change` applied to each of its segments."""
        map_segments, previous_change = copy(self), self._change
        map_segments._change = lambda segment: change(previous_change(segment))
        return map_segments

    def report(self, figures: dict[str, Any], sentence: str) -> None:
        """Add figures of the written file, or a note with them."""
        if self.figures is None:
            self.notes.result(sentence)
        else:
            self.figures |= figures

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type that holds the positions of all segments."""
        segments = self._sequence.segments
        return np.result_type(*(segments[number].dtype for number, _ in self._segment_frames))

    def frames(self) -> Iterator[Vertices]:
        """Yield the positions of all frames, without decoding surfaces."""
        for number, frames in self._segment_frames:
            for block in _blocks(self._sequence.segments[number], frames):
                yield from block

    def meshes(self) -> Iterator[FrameStream]:
        """Yield each segment for its mesh, without notes and progress."""
        for number, frames in self._segment_frames:
            yield self._stream(number, frames, Notes(), silent, self.timing)

    def segments(self) -> Iterator[FrameStream]:
        """Yield each segment in order; read its frames before the next one."""
        for first, (number, frames) in zip(self.starts, self._segment_frames, strict=False):
            notes: Notes = self.notes if self.n_segments == 1 else Notes()
            timing = self.timing.part(range(first, first + len(frames)))
            progress = partial(self._report, first)
            yield self._stream(number, frames, notes, progress, timing)
            if notes is not self.notes:
                self.notes.add_all(notes)

    def only(self) -> FrameStream:
        """Return the only segment."""
        [segment] = self.segments()
        return segment

    def _stream(
        self, number: int, frames: range, notes: Notes, progress: Progress, timing: Timing
    ) -> FrameStream:
        source = self._sequence.segments[number]
        tracks = {
            name: track if len(frames) == track.shape[0] else TrackPart(track, frames)
            for name, track in source.tracks.items()
        }
        stream = FrameStream(
            source, frames, *self._mesh(number, source), tracks, self.name, timing, progress, notes
        )
        return self._change(stream)

    def _mesh(self, number: int, source: Any) -> tuple[Faces, Surface]:
        """Return the faces and the surface of a segment."""
        if number in self._cached_meshes:
            return self._cached_meshes[number]
        faces, surface = source.faces, source.surface
        size_bytes = faces.nbytes + surface.size_bytes + surface.image_bytes
        if self._cached_bytes + size_bytes <= MAX_CACHED_BYTES:
            self._cached_meshes[number] = faces, surface
            self._cached_bytes += size_bytes
        return faces, surface

    def _report(self, first: int, stage: str, share: float) -> None:
        """Count frames of the segment that begins at frame `first` as frames of the sequence."""
        if isinstance(share, Count) and share.unit == "frames":
            share = Count(first + share.done, self.n_frames, share.unit)
        self.progress(stage, share)


def _blocks(source: Any, frames: range) -> Iterator[Vertices]:
    """Yield the positions of consecutive frames, in as large blocks as the source decodes."""
    if (pieces := getattr(source, "pieces", None)) is not None:
        yield from (block for _, block in pieces(frames))
    else:
        yield from (source.read(index, index + 1) for index in frames)
