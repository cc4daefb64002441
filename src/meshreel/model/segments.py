"""SegmentedSequence: an animated mesh whose connectivity changes from segment to segment."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import blake2b
from itertools import pairwise
from typing import Any, NamedTuple, Protocol, SupportsIndex, overload, runtime_checkable

import numpy as np
import numpy.typing as npt

from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.model.extent import Extent
from meshreel.model.frame_choice import chosen_frames, start_of
from meshreel.model.sequence import (
    Faces,
    FrameContents,
    FrameSource,
    MeshSequence,
    Vertices,
    positions_size_bytes,
)
from meshreel.model.tracks import TrackSource, read_track
from meshreel.model.validation import validate_start
from meshreel.runtime.counting import counted


class MeshFrame(NamedTuple):
    """A frame: positions of shape (V, 3) and faces of shape (M, 3)."""

    vertices: Vertices
    faces: Faces


@dataclass(frozen=True, eq=False)
class SegmentedSequence:
    """An animated mesh in segments, each of which has constant connectivity.

    Its length is the number of frames, which are numbered across all segments. ``sequence[3]`` is
    a `MeshFrame`: positions and faces; a slice gives a shorter `SegmentedSequence`; iterating
    gives all frames in turn. ``a + b`` and `meshreel.concatenate` append sequences.

    Parameters
    ----------
    segments : iterable of MeshSequence, or of FrameSource
        In order of time, at least one. Adjacent segments may have equal faces.
    name : str, optional
        A name to show. Default: that of the first segment.
    start_s : float, optional
        Time of the first frame, in seconds. Default: that of the first segment. Times of other
        segments follow from the frame rate.

    Raises
    ------
    InvalidInputError
        If there is no segment, or frame rates differ.
    """

    segments: tuple[FrameSource, ...]
    name: str = ""
    start_s: float = 0.0

    def __init__(
        self,
        segments: Iterable[FrameSource],
        name: str | None = None,
        start_s: float | None = None,
    ) -> None:
        several = tuple(segments)
        if not several:
            raise InvalidInputError("a sequence needs at least one segment; got none")
        rates = sorted({segment.fps for segment in several})
        if len(rates) > 1:
            raise InvalidInputError(
                f"segments have {' and '.join(f'{rate:g}' for rate in rates)} frames per second; "
                "give them the same fps"
            )
        first = several[0]
        object.__setattr__(self, "segments", several)
        object.__setattr__(self, "name", first.name if name is None else name)
        start = first.start_s if start_s is None else validate_start(start_s)
        object.__setattr__(self, "start_s", start)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """First frame of each segment, and the number of all frames."""
        counts = [segment.n_frames for segment in self.segments]
        return (0, *np.cumsum(counts).tolist())

    @property
    def n_frames(self) -> int:
        """Number of frames of all segments, T."""
        return self.starts[-1]

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self.segments)

    @cached_property
    def n_meshes(self) -> int:
        """Number of distinct meshes: segments with the same vertices and faces share one."""
        digests = {
            mesh_digest(one.n_verts, one.faces, one.surface.sizes(len(one.faces)))
            for one in self.segments
        }
        return len(digests)

    @property
    def fps(self) -> float:
        """Frames per second; 0 = unknown."""
        return self.segments[0].fps

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Widest number type of the positions of a segment."""
        return np.dtype(max((one.dtype for one in self.segments), key=lambda one: one.itemsize))

    @property
    def raw_size_bytes(self) -> int:
        """Bytes of the plain arrays of positions and faces."""
        return sum(
            positions_size_bytes(segment) + segment.faces.nbytes for segment in self.segments
        )

    @cached_property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""
        extents = [segment.extent for segment in self.segments]
        weights = [segment.n_frames for segment in self.segments]
        return Extent(
            np.min([one.low for one in extents], axis=0),
            np.max([one.high for one in extents], axis=0),
            float(np.average([one.mean_diagonal for one in extents], weights=weights)),
        )

    def segment(self, number: int) -> FrameSource:
        """Return a segment, whose frames count from 0."""
        return self.segments[number]

    def segment_of(self, frame: int) -> int:
        """Return the number of the segment that contains a frame of 0..T-1."""
        return segment_containing(self.starts, frame)

    def frame(self, number: int) -> MeshFrame:
        """Return a frame of 0..T-1."""
        return frame_at(self, number)

    def __len__(self) -> int:
        return self.n_frames

    @overload
    def __getitem__(self, chosen: SupportsIndex) -> MeshFrame: ...

    @overload
    def __getitem__(self, chosen: slice) -> "SegmentedSequence": ...

    def __getitem__(self, chosen: SupportsIndex | slice) -> "MeshFrame | SegmentedSequence":
        """Return a frame, or the frames of a slice without a step as a `SegmentedSequence`."""
        if not isinstance(chosen, slice):
            numbers = chosen_frames(chosen, self.n_frames)
            if isinstance(numbers, int):
                return self.frame(numbers)
            raise TypeError("frames of a SegmentedSequence are chosen by a number or a slice")
        frames = range(self.n_frames)[chosen]
        if frames.step != 1 or not frames:
            raise InvalidInputError(
                f"a slice of a SegmentedSequence names at least one frame and has no step; "
                f"got {chosen} of {counted(self.n_frames, 'frame')}"
            )
        return self.part(frames)

    def part(self, frames: range) -> "SegmentedSequence":
        """Return consecutive frames; segments that are cut are copied, with their tracks."""
        segments = []
        for segment, (first, end) in zip(self.segments, pairwise(self.starts), strict=True):
            start, stop = max(first, frames.start), min(end, frames.stop)
            if start < stop:
                wanted = range(start - first, stop - first)
                is_whole = len(wanted) == segment.n_frames
                segments.append(segment if is_whole else frames_of(segment, wanted))
        return SegmentedSequence(segments, self.name, start_of(frames, self.start_s, self.fps))

    def __iter__(self) -> Iterator[MeshFrame]:
        return map(self.frame, range(self.n_frames))

    def __add__(self, other: "AnySequence") -> "SegmentedSequence":
        return concatenate([self, other])

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return (
            f"<SegmentedSequence{name}: {self.n_frames} frames in "
            f"{counted(self.n_segments, 'segment')}, {self.fps:g} fps, {self.dtype}>"
        )


@runtime_checkable
class HasSegments(Protocol):
    """A sequence or a file in segments of constant connectivity."""

    @property
    def n_segments(self) -> int:
        """Number of segments."""

    @property
    def starts(self) -> tuple[int, ...]:
        """First frame of each segment, and the number of all frames."""

    def segment(self, number: int) -> Any:
        """Return a segment, whose frames count from 0."""


def each_segment(sequence: Any) -> Iterator[Any]:
    """Yield each segment of a sequence or a file; one of constant connectivity is its own.

    Files decode segments on demand: a caller that keeps none needs memory for a few of them.
    """
    if isinstance(sequence, HasSegments):
        yield from map(sequence.segment, range(sequence.n_segments))
    else:
        yield sequence


AnySequence = FrameSource | SegmentedSequence
"""An animated mesh, with or without changes of its connectivity."""


def mesh_digest(n_verts: int, *faces: npt.NDArray[np.signedinteger]) -> bytes:
    """Return a digest that is equal for meshes with the same number of vertices and faces.

    Parameters
    ----------
    faces : integer arrays
        Arrays that describe the faces, such as vertex indices and face sizes.
    """
    digest = blake2b(n_verts.to_bytes(8, "little"), digest_size=16)
    for array in faces:
        digest.update(len(array).to_bytes(8, "little"))
        digest.update(np.ascontiguousarray(array, np.int64).data)
    return digest.digest()


def tracks_of_all(sequence: AnySequence) -> dict[str, TrackSource]:
    """Return the tracks of all segments by name; of equal names the first."""
    segments = reversed(segments_of(sequence))
    return {name: track for one in segments for name, track in one.tracks.items()}


def segment_containing(starts: tuple[int, ...], frame: int) -> int:
    """Return the number of the segment that contains a frame, given the first frame of each."""
    return bisect_right(starts, frame) - 1


def frame_at(sequence: HasSegments, number: int) -> MeshFrame:
    """Return frame 0..T-1 of a sequence or a file in segments."""
    index = segment_containing(sequence.starts, number)
    segment, local = sequence.segment(index), number - sequence.starts[index]
    return MeshFrame(segment.read(local, local + 1)[0], segment.faces)


def segments_of(sequence: AnySequence) -> tuple[FrameSource, ...]:
    """Return the segments of a sequence; a sequence of constant connectivity is its own."""
    return sequence.segments if isinstance(sequence, SegmentedSequence) else (sequence,)


def concatenate(sequences: Iterable[AnySequence]) -> SegmentedSequence:
    """Return the frames of several sequences in order, each of which begins a segment.

    Parameters
    ----------
    sequences : iterable of MeshSequence or SegmentedSequence
        At least one; all of the same frame rate. Name and start are those of the first.

    Raises
    ------
    InvalidInputError
        If there is no sequence, or frame rates differ.
    """
    several = list(sequences)
    if not several:
        raise InvalidInputError("there are no sequences to concatenate; at least one is needed")
    segments = [segment for sequence in several for segment in segments_of(sequence)]
    return SegmentedSequence(segments, several[0].name, several[0].start_s)


def single_segment(sequence: AnySequence, purpose: str) -> FrameSource:
    """Return a sequence of constant connectivity.

    Parameters
    ----------
    purpose : str
        What needs it, for the error message, such as "writing walk.mdd".

    Raises
    ------
    ConnectivityChangeError
        If the connectivity changes.
    """
    if not isinstance(sequence, SegmentedSequence):
        return sequence
    if sequence.n_segments > 1:
        raise ConnectivityChangeError(
            f"the faces change: {counted(sequence.n_frames, 'frame')} in {sequence.n_segments} "
            f"segments; {purpose} needs the same faces in every frame"
        )
    return sequence.segments[0]


def with_rate(sequence: SegmentedSequence, fps: float, name: str) -> SegmentedSequence:
    """Return the sequence with another frame rate and name."""
    segments = sequence.segments
    if fps != sequence.fps:
        segments = tuple(
            replace(frames_of(segment, range(segment.n_frames)), fps=fps) for segment in segments
        )
    return SegmentedSequence(segments, name, sequence.start_s)


def frames_of(segment: FrameContents, wanted: range) -> MeshSequence:
    """Return consecutive frames of a sequence of constant connectivity, with their tracks."""
    return MeshSequence(
        segment.read(wanted.start, wanted.stop),
        segment.faces,
        segment.fps,
        segment.name,
        start_of(wanted, segment.start_s, segment.fps),
        segment.surface,
        {name: read_track(track, wanted) for name, track in segment.tracks.items()},
    )
