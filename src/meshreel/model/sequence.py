"""MeshSequence: an animated triangle mesh of one or more segments of constant connectivity."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from hashlib import blake2b
from itertools import accumulate, pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.model.cells import Cells
from meshreel.model.extent import Extent, Vertices, extent_of
from meshreel.model.frame_choice import frame_number, frame_range
from meshreel.model.labeled_arrays import track_dataset
from meshreel.model.showing import notebook_html, show
from meshreel.model.surface import PLAIN, Surface, surface_of_cells
from meshreel.model.timing import Timed, Timing
from meshreel.model.tracks import (
    Track,
    TrackKind,
    TrackSource,
    error_bound_of,
    track_like,
    validated_tracks,
)
from meshreel.model.validation import (
    Faces,
    frozen,
    hand_over,
    restore,
    validate_faces,
    validate_vertices,
)
from meshreel.runtime.counting import counted, counts_text

__all__ = [
    "Faces",
    "FrameSource",
    "MeshFrame",
    "MeshSequence",
    "Vertices",
    "concatenate",
    "frames_by_segment",
    "frames_of",
    "is_still",
    "mesh_digest",
    "positions_size_bytes",
    "segment_of_frame",
    "single_segment",
    "tracks_of_all",
]


OF_ONE_SEGMENT = {"vertices", "faces", "n_verts", "n_faces", "surface", "tracks"}
"""Attributes that only sequences with a single segment have."""

TIMING_PARAMETERS = {"fps", "start_s", "times", "timing"}
PARAMETERS = {"vertices", "faces", "surface", "tracks", "name", *TIMING_PARAMETERS}
"""Parameters of `MeshSequence.replace`."""


class MeshFrame(NamedTuple):
    """A frame: positions of shape (V, 3) and faces of shape (M, 3)."""

    vertices: Vertices
    faces: Faces


class FrameSource(Protocol):
    """Frames of constant connectivity, which are in memory or read on demand."""

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions: float32 or float64."""

    @property
    def faces(self) -> Faces:
        """Vertex indices of each triangle, of shape (M, 3)."""

    @property
    def timing(self) -> Timing:
        """Frame rate and start, or the times of the frames."""

    @property
    def name(self) -> str:
        """A name for display."""

    @property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh."""

    @property
    def tracks(self) -> Mapping[str, TrackSource]:
        """Quantities that change over time, other than the positions, by name."""

    @property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3), all finite."""


class MeshSequence(Timed):
    """An animated triangle mesh of one or more segments, each of which has constant connectivity.

    Most sequences have one segment and are made of arrays; `of_segments` and `concatenate` make
    sequences of several, whose faces change. Its length is the number of frames. ``sequence[3]``
    is a `MeshFrame`, positions and faces; a slice is a shorter sequence, ``sequence[::2]`` of half
    the frame rate, ``sequence[::-1]`` backwards in time, with opposite velocities; iteration yields
    all frames in order; ``a + b`` appends; ``np.asarray(sequence)`` is the positions of a single
    segment. A sequence does not change: `replace` returns another.
    Arrays are validated and stored read-only (faces as int32), as copies unless they are read-only.

    Parameters
    ----------
    vertices : float32 or float64 array of shape (T, V, 3)
        Positions in model units; every value finite. T and V are at least 1.
    faces : integer array of shape (M, 3)
        Vertex indices of each triangle, in 0..V-1. M is at least 1. Not with `cells`.
    fps : float, default 0
        Frames per second; 0 means unknown.
    name : str, default ""
        A name for display; it has no other effect.
    start_s : float, default 0
        Time of the first frame, in seconds.
    times : float array of shape (T,), optional
        Time of each frame in seconds, finite and ascending, in place of `fps` and `start_s`. Frames
        that are evenly spaced, within an ulp of the last time, get a frame rate.
    cells : Cells, optional
        Cells of a volume mesh, whose surface are the faces. ``sequence.surface.cells`` has them.
    surface : Surface, optional
        Polygons, texture coordinates, colors, materials and merged parts of the mesh. Default:
        none.
    tracks : mapping of str to Track, or to arrays of shape (T, N) or (T, N, C), optional
        Quantities that change over time, such as stress or velocity, by name. An array belongs to
        vertices, cells, faces or corners: the first that number N. ``sequence.tracks[name]`` is a
        `Track`. Default: none.

    Attributes
    ----------
    timing : Timing
        Frame rate and start, or the times of the frames.
    segments : tuple of FrameSource
        In order of time; a sequence of arrays is its own segment.
    n_segments, n_frames : int
    starts : tuple of int
        First frame of each segment, and the number of all frames.
    error_bound : float or None
        Guaranteed largest distance of vertices from the original, in model units: 0 for original
        positions, such as those of an array; None if they were decoded from a stream that
        guarantees none.
    vertices, faces, n_verts, n_faces, surface, tracks
        Only with one segment; otherwise they raise ConnectivityChangeError. Positions that are not
        in memory are read whenever `vertices` is accessed; `read` reads some of them.

    Raises
    ------
    InvalidInputError
        If an array has another shape or type, a position is not finite, a face refers to a vertex
        that does not exist, the frame rate is negative or not finite, the times do not ascend or
        come with a rate, or the surface or a track does not fit.
    """

    name: str
    starts: tuple[int, ...]
    dtype: np.dtype[np.floating]
    error_bound: float | None
    _segments: tuple[FrameSource, ...]  # empty if the sequence consists of arrays

    # Set for sequences of arrays; `__getattr__` returns those of other sequences.
    n_verts: int
    n_faces: int
    vertices: Vertices
    faces: Faces
    surface: Surface
    _tracks: dict[str, Track]

    def __init__(
        self,
        vertices: Vertices,
        faces: Faces | None = None,
        fps: float = 0.0,
        name: str = "",
        start_s: float = 0.0,
        surface: Surface = PLAIN,
        tracks: Mapping[str, Any] | None = None,
        times: Sequence[float] | Floats | None = None,
        cells: Cells | None = None,
    ) -> None:
        vertices = validate_vertices(vertices)
        if cells is not None:
            if faces is not None:
                raise InvalidInputError("give either faces or cells, whose surface has the faces")
            faces, polygons = surface_of_cells(cells, vertices.shape[1])
            surface = replace(surface, face_sizes=polygons.face_sizes, cells=polygons.cells)
        if faces is None:
            raise InvalidInputError("a mesh needs faces, or cells, whose surface has the faces")
        timing = Timing.of_rate(fps, start_s)
        if times is not None:
            if timing != Timing():
                raise InvalidInputError("give either times, or fps and start_s; got both")
            timing = Timing.of_times(times, len(vertices))
        self._set(vertices, faces, name, timing, surface, tracks or {})

    @classmethod
    def of_finite(
        cls,
        vertices: Vertices,
        faces: Faces,
        name: str,
        timing: Timing,
        surface: Surface,
        tracks: Mapping[str, Track],
        error_bound: float | None = 0.0,
    ) -> "MeshSequence":
        """Return a sequence of positions of shape (T, V, 3) that the caller knows to be finite.

        Decoders have checked them already; everything else is validated. `error_bound` is that of
        the positions.
        """
        sequence = cls.__new__(cls)
        sequence._set(vertices, faces, name, timing, surface, tracks, error_bound)
        return sequence

    @classmethod
    def of_segments(
        cls,
        segments: Iterable[FrameSource],
        name: str | None = None,
        timing: Timing | None = None,
    ) -> "MeshSequence":
        """Return a sequence of segments in order of time.

        Parameters
        ----------
        segments : iterable of FrameSource
            At least one. Adjacent segments may have equal faces; a
            `MeshSequence` of several segments contributes all of them.
        name, timing : optional
            Default: the name of the first segment, and `Timing.joined` of all.

        Raises
        ------
        InvalidInputError
            If there is no segment, or their times do not fit: see `Timing.joined`.
        """
        parts: list[FrameSource] = []
        inputs = list(segments)
        for segment in inputs:
            parts += segment.segments if isinstance(segment, MeshSequence) else [segment]
        if not parts:
            raise InvalidInputError("a sequence needs at least one segment; got none")
        first = parts[0]
        name = first.name if name is None else name
        if timing is None:
            timing = Timing.joined(
                [segment.timing for segment in inputs], [segment.n_frames for segment in inputs]
            )
        if len(parts) == 1 and (name, timing) != (first.name, first.timing):
            first = _replaced(first, {"name": name, "timing": timing})
        if len(parts) == 1:
            if isinstance(first, MeshSequence):
                return first
            parts = [first]
        sequence = cls.__new__(cls)
        starts = (0, *accumulate(part.n_frames for part in parts))
        vars(sequence).update(
            name=name,
            timing=timing,
            starts=starts,
            n_frames=starts[-1],
            dtype=np.result_type(*(part.dtype for part in parts)),
            error_bound=error_bound_of(*parts),
            _segments=tuple(parts),
        )
        return sequence

    def _set(
        self,
        vertices: Vertices,
        faces: Faces,
        name: str,
        timing: Timing,
        surface: Surface,
        tracks: Mapping[str, Any],
        error_bound: float | None = 0.0,
    ) -> None:
        """Store the arrays read-only, and validate all but the positions."""
        n_frames, n_verts, _ = vertices.shape
        timing.check(n_frames)
        if not isinstance(name, str):
            raise InvalidInputError(f"name must be text; got {name!r:.60}")
        faces = frozen(validate_faces(faces, n_verts, n_frames))
        surface = surface if surface is PLAIN else surface.validated(n_verts, faces)
        vars(self).update(
            name=name,
            timing=timing,
            starts=(0, n_frames),
            dtype=vertices.dtype,
            n_frames=n_frames,
            n_verts=n_verts,
            n_faces=len(faces),
            vertices=frozen(vertices),
            faces=faces,
            surface=surface,
            _tracks=dict(
                tracks and validated_tracks(tracks, n_frames, n_verts, len(faces), surface)
            ),
            error_bound=error_bound,
            _segments=(),
        )

    __setstate__ = restore

    def __setattr__(self, name: str, value: object) -> None:
        """Raise AttributeError: a sequence does not change."""
        change = f"{name}=..." if name in PARAMETERS else "..."
        raise AttributeError(
            f"a MeshSequence does not change; use sequence.replace({change}), which returns another"
        )

    def __delattr__(self, name: str) -> None:
        """Raise AttributeError as `__setattr__`."""
        self.__setattr__(name, None)

    @property
    def tracks(self) -> Mapping[str, Any]:
        """Tracks by name, of a sequence of one segment."""
        return self._only("tracks").tracks if self._segments else MappingProxyType(self._tracks)

    def to_xarray(self) -> Any:
        """Return the tracks of a single segment as an ``xarray.Dataset``; needs the extra [xarray].

        Dimensions are time, node (cell, face or corner) and, of vectors, component (component_N for
        N other than 3); the coordinate is the time in seconds; attributes are ``units``, ``kind``
        and ``error_bound``.
        """
        return track_dataset(self.tracks, self.times)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the only segment; raises ConnectivityChangeError for several."""
        if name not in OF_ONE_SEGMENT:
            raise AttributeError(f"a MeshSequence has no attribute {name!r}")
        segment = self._only(name)
        if name == "vertices":
            return segment.read(0, segment.n_frames)
        return len(segment.faces) if name == "n_faces" else getattr(segment, name)

    def replace(self, **changes: Any) -> "MeshSequence":
        """Return the sequence with other values of some parameters of the constructor.

        Sequences of several segments have no vertices, faces, surface and tracks to replace.
        `times` and `fps` replace each other; `start_s` alone shifts times. ``timing=`` replaces all
        three.
        """
        if unknown := changes.keys() - PARAMETERS - {"error_bound"}:
            raise InvalidInputError(
                f"replace has no parameter {min(unknown)!r}; it has "
                f"{', '.join(sorted(PARAMETERS))}; sequence[2:5] selects frames"
            )
        n_frames = len(changes["vertices"]) if "vertices" in changes else self.n_frames
        timing, changes = _timing_after(self.timing, changes, n_frames)
        if len(self._segments) == 1:
            changes = {"timing": timing, **changes}
            return MeshSequence.of_segments([_replaced(self._segments[0], changes)])
        if self._segments:
            for name in OF_ONE_SEGMENT & changes.keys():
                self._only(name)
            name = changes.pop("name", self.name)
            segments = self._segments
            if timing != self.timing:
                parts = (timing.part(range(*ends)) for ends in pairwise(self.starts))
                segments = tuple(
                    _replaced(segment, {"timing": part})
                    for segment, part in zip(segments, parts, strict=True)
                )
            return MeshSequence.of_segments(segments, name, timing)
        names = "vertices", "faces", "name", "surface", "tracks"
        values = {name: getattr(self, name) for name in names} | changes
        values.setdefault("error_bound", 0.0 if "vertices" in changes else self.error_bound)
        if "vertices" in changes:
            values["vertices"] = validate_vertices(values["vertices"])
        return MeshSequence.of_finite(timing=timing, **values)

    @property
    def is_original(self) -> bool:
        """Whether nothing was decoded from a lossy stream, and no track moved the vertices."""
        parts = self.segments
        sources = (one for part in parts for one in (part, *part.tracks.values()))
        is_displaced = any(part.surface.displaced_by for part in parts)
        return not is_displaced and not any(
            getattr(one, "error_bound", 0.0) != 0 for one in sources
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the positions, (T, V, 3), of a sequence of one segment."""
        return self.n_frames, self.n_verts, 3

    @property
    def segments(self) -> tuple[FrameSource, ...]:
        """Segments in order of time, whose frames count from 0."""
        return self._segments or (self,)

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self._segments) or 1

    def _only(self, name: str) -> FrameSource:
        """Return the only segment, for its attribute `name`; raises as `__getattr__`."""
        if len(self._segments) > 1:
            raise ConnectivityChangeError(
                f"the faces change: each of {self.n_segments} segments has its own {name}; use "
                f"sequence.segments[0].{name}, or iterate over frames, which have vertices and "
                "faces"
            )
        return self._segments[0]

    @cached_property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""
        if not self._segments:
            return extent_of(self.vertices)
        extents = [segment.extent for segment in self._segments]
        weights = [segment.n_frames for segment in self._segments]
        return Extent(
            np.min([extent.low for extent in extents], axis=0),
            np.max([extent.high for extent in extents], axis=0),
            float(np.average([extent.mean_diagonal for extent in extents], weights=weights)),
        )

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the frames are read from."""
        return tuple(file for segment in self._segments for file in getattr(segment, "files", ()))

    @property
    def n_meshes(self) -> int:
        """Number of distinct meshes: segments with the same vertices and faces share one."""
        digests = {
            mesh_digest(segment.n_verts, segment.faces, segment.surface.sizes(len(segment.faces)))
            for segment in self.segments
        }
        return len(digests)

    @property
    def raw_size_bytes(self) -> int:
        """Size of the uncompressed arrays; of several segments, of positions and faces."""
        if self._segments:
            return sum(
                positions_size_bytes(segment) + segment.faces.nbytes for segment in self._segments
            )
        tracks_bytes = sum(track.values.nbytes for track in self.tracks.values())
        mesh_bytes = self.faces.nbytes + self.surface.size_bytes
        return int(self.vertices.nbytes + mesh_bytes + tracks_bytes)

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3)."""
        if self._segments:
            return self._only("vertices").read(start, stop)
        return self.vertices[start:stop]

    def __len__(self) -> int:
        return self.n_frames

    @overload
    def __getitem__(self, index: SupportsIndex) -> MeshFrame: ...

    @overload
    def __getitem__(self, index: slice) -> "MeshSequence": ...

    def __getitem__(self, index: SupportsIndex | slice) -> "MeshFrame | MeshSequence":
        """Return a frame, or the frames of a slice as a sequence."""
        if isinstance(index, slice):
            return self.part(frame_range(index, self.n_frames))
        return frame_of(self.segments, self.starts, index)

    def __iter__(self) -> Iterator[MeshFrame]:
        for segment in self.segments:
            faces = segment.faces
            for number in range(segment.n_frames):
                yield MeshFrame(segment.read(number, number + 1)[0], faces)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Vertices:
        """Positions of the only segment; raises ConnectivityChangeError for several."""
        if copy is None:  # which NumPy 1 does not take
            return np.asarray(self.vertices, dtype)
        return np.array(self.vertices, dtype, copy=copy)

    def __add__(self, other: "MeshSequence") -> "MeshSequence":
        return concatenate([self, other])

    def part(self, frames: range) -> "MeshSequence":
        """Return some frames; segments that are cut are loaded, with their tracks."""
        parts: list[FrameSource] = []
        timing, n_done = self.timing.part(frames), 0
        for number, local_frames in frames_by_segment(self.starts, frames):
            segment = self.segments[number]
            is_whole = local_frames == range(segment.n_frames) and frames.step > 0
            n_frames = len(local_frames)
            own_timing = timing.part(range(n_done, n_done + n_frames))
            parts.append(segment if is_whole else frames_of(segment, local_frames, own_timing))
            n_done += n_frames
        return MeshSequence.of_segments(parts, self.name, timing)

    _repr_html_ = notebook_html
    show = show

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        if self.n_segments > 1:
            mesh = f"{self.n_frames} frames in {self.n_segments} segments"
            tracks = ""
        else:
            mesh = counts_text(frame=self.n_frames, vertex=self.n_verts, face=self.n_faces)
            tracks = f"; tracks {', '.join(self.tracks)}" if self.tracks else ""
        return f"<MeshSequence{name}: {mesh}, {self.fps:g} fps, {self.dtype}{tracks}>"


def _replaced(segment: Any, changes: dict[str, Any]) -> FrameSource:
    """Return a segment with changes; a `FrameSource` of another class needs a method `replace`."""
    replaced: FrameSource = segment.replace(**changes) if changes else segment
    return replaced


def _timing_after(
    timing: Timing, changes: dict[str, Any], n_frames: int
) -> tuple[Timing, dict[str, Any]]:
    """Return the timing of `MeshSequence.replace`, and the changes of other parameters."""
    others = {name: value for name, value in changes.items() if name not in TIMING_PARAMETERS}
    fps, start_s = changes.get("fps", timing.fps), changes.get("start_s", timing.start_s)
    if changes.get("times") is not None:
        if changes.keys() & {"fps", "start_s"}:
            raise InvalidInputError("give either times, or fps and start_s; got both")
        return Timing.of_times(changes["times"], n_frames), others
    if "timing" in changes:
        return changes["timing"], others
    if (fps, start_s) == (timing.fps, timing.start_s):
        return timing, others
    if "fps" not in changes and timing.times is not None:
        return Timing.of_times(timing.times + (start_s - timing.start_s), n_frames), others
    return Timing.of_rate(fps, start_s), others


def positions_size_bytes(source: FrameSource) -> int:
    """Size of the positions of all frames in memory, in bytes."""
    return source.n_frames * source.n_verts * 3 * source.dtype.itemsize


def segment_of_frame(starts: tuple[int, ...], frame: int) -> tuple[int, int]:
    """Number of the segment that contains a frame, and the number of the frame in it.

    Parameters
    ----------
    starts : tuple of int
        First frame of each segment, and the number of all frames, T.
    frame : int
        In 0..T-1.
    """
    number = bisect_right(starts, frame) - 1
    return number, frame - starts[number]


def frames_by_segment(starts: tuple[int, ...], frames: range) -> Iterator[tuple[int, range]]:
    """Yield the number of each segment that has some of these frames, and their numbers in it.

    Segments are in the order of the frames.

    Parameters
    ----------
    starts : tuple of int
        First frame of each segment, and the number of all frames, T.
    frames : range
        Frames in 0..T-1, with any step.
    """
    direction = 1 if frames.step > 0 else -1
    ascending = frames[::direction]
    for number, (first, end) in [*enumerate(pairwise(starts))][::direction]:
        part = ascending[bisect_left(ascending, first) : bisect_left(ascending, end)]
        if part:
            yield number, range(part.start - first, part.stop - first, part.step)[::direction]


def frame_of(segments: Sequence[Any], starts: tuple[int, ...], number: SupportsIndex) -> MeshFrame:
    """Return a frame of several segments; negative numbers count from the end.

    Parameters
    ----------
    segments : sequence of FrameSource or ReelFile
    starts : tuple of int
        First frame of each, and the number of all frames.

    Raises
    ------
    MissingFrameError
        If the frame does not exist.
    TypeError
        If the number is not an integer.
    """
    index, frame = segment_of_frame(starts, frame_number(number, starts[-1]))
    segment = segments[index]
    return MeshFrame(segment.read(frame, frame + 1)[0], segment.faces)


def frames_of(
    segment: Any,
    frames: range,
    timing: Timing | None = None,
    prepare: Callable[[Any], Any] = frozen,
) -> MeshSequence:
    """Load some frames of a `FrameSource` or a `ReelFile` of one segment, with tracks.

    `prepare` makes the arrays read-only that the segment returns: `hand_over` if they are new. With
    a negative step, velocities are the opposite.
    """

    def read(source: Any) -> Any:
        if frames.step == 1:
            return prepare(source.read(frames.start, frames.stop))
        values = np.concatenate([source.read(number, number + 1) for number in frames])
        is_turned = frames.step < 0 and getattr(source, "kind", "") == TrackKind.VELOCITY
        return hand_over(-values if is_turned else values)

    vertices = read(segment)
    # Positions of sequences in memory are finite already.
    return MeshSequence.of_finite(
        vertices if isinstance(segment, MeshSequence) else validate_vertices(vertices),
        segment.faces,
        segment.name,
        segment.timing.part(frames) if timing is None else timing,
        segment.surface,
        {name: track_like(track, read(track)) for name, track in segment.tracks.items()},
        error_bound_of(segment),
    )


def concatenate(sequences: Iterable[MeshSequence]) -> MeshSequence:
    """Return the frames of several sequences in order, each of which begins a segment.

    Parameters
    ----------
    sequences : iterable of MeshSequence
        At least one. Name and start are those of the first. Frames keep their times if each
        sequence begins after the last frame of the one before. Otherwise all must have the same
        frame rate, and follow the first sequence at that rate.

    Raises
    ------
    InvalidInputError
        If there is no sequence, another object, or the times do not fit.
    """
    parts = list(sequences)
    if not parts:
        raise InvalidInputError("there are no sequences to concatenate; at least one is needed")
    for part in parts:
        if not isinstance(part, MeshSequence):
            raise InvalidInputError(
                "concatenate takes a list of sequences, as in concatenate([first, second]); got a "
                f"{type(part).__name__}"
            )
    return MeshSequence.of_segments(parts, parts[0].name)


def single_segment(sequence: MeshSequence, purpose: str) -> FrameSource:
    """Return the only segment of a sequence.

    Parameters
    ----------
    purpose : str
        What needs constant connectivity, for the error message, such as "writing walk.mdd".

    Raises
    ------
    ConnectivityChangeError
        If the connectivity changes.
    """
    if sequence.n_segments > 1:
        raise ConnectivityChangeError(
            f"the faces change: {counted(sequence.n_frames, 'frame')} in {sequence.n_segments} "
            f"segments; {purpose} needs the same faces in every frame"
        )
    return sequence.segments[0]


def tracks_of_all(sequence: MeshSequence) -> dict[str, TrackSource]:
    """Return the tracks of all segments by name: the first of each name."""
    segments = reversed(sequence.segments)
    return {name: track for segment in segments for name, track in segment.tracks.items()}


def is_still(sequence: FrameSource) -> bool:
    """Return whether all frames have the same positions; reads until one differs."""
    first = sequence.read(0, 1)
    others = range(1, sequence.n_frames)
    return all(np.array_equal(first, sequence.read(number, number + 1)) for number in others)


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
