"""Sequences and tracks that are read from their files on demand; surveys of their frames."""

import math
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values, native
from meshreel.errors import InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.extent import Corners, Extent, bounding_boxes, extent_of_boxes
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.timing import UNTIMED, Timed, Timing
from meshreel.model.tracks import (
    Track,
    TrackKind,
    TrackSource,
    check_kind,
    check_tracks,
    read_tracks,
    size_bytes,
)
from meshreel.model.validation import (
    frozen,
    hand_over,
    validate_faces,
    validate_finite,
    validate_vertices,
)
from meshreel.runtime.progress import Count, Progress, silent

MESH_FIELDS = {"faces", "surface", "tracks"}


@dataclass(frozen=True, eq=False)
class StoredFrames(Timed):
    """A `FrameSource` whose positions, and perhaps faces, surface and tracks, are in files."""

    n_frames: int
    n_verts: int
    dtype: np.dtype[np.floating]
    """float32 or float64."""
    name: str
    read_range: Callable[[int, int], Vertices]
    """Reads the positions of frames start..stop - 1, of shape (stop - start, V, 3)."""
    read_faces: Callable[[], Faces]
    read_surface: Callable[[], Surface]
    read_tracks: Callable[[], Mapping[str, TrackSource]]
    read_extent: Callable[[], Extent]
    """Returns the bounding box of all frames, in `dtype`."""
    error_bound: float | None = 0.0
    """As of a `MeshSequence`."""
    timing: Timing = UNTIMED
    files: tuple[Path, ...] = ()
    """Files with the positions."""
    keeps_mesh: bool = True
    """Whether faces, surface and tracks are in memory."""
    pieces: Callable[[range], Iterator[tuple[int, Vertices]]] | None = None
    """Yields runs of consecutive frames that are read together: number of the first, and positions.
    Default: frames are read one at a time.
    """

    @property
    def faces(self) -> Faces:
        """Integer array of shape (M, 3)."""
        return self.read_faces()

    @property
    def surface(self) -> Surface:
        """As in `MeshSequence`."""
        return self.read_surface()

    @property
    def tracks(self) -> Mapping[str, TrackSource]:
        """Tracks by name, whose values are read on demand."""
        return self.read_tracks()

    @cached_property
    def extent(self) -> Extent:
        """Bounding box of all frames."""
        return self.read_extent()

    def __post_init__(self) -> None:
        self.timing.check(self.n_frames)

    def replace(self, **changes: Any) -> "StoredFrames":
        """Return a copy with other values of some parameters of `MeshSequence`.

        Raises
        ------
        InvalidInputError
            If faces, surface or tracks do not fit.
        """
        if changed_names := MESH_FIELDS & changes.keys():
            mesh = {name: changes.pop(name, getattr(self, name)) for name in MESH_FIELDS}
            readers = _mesh_readers(self.n_frames, self.n_verts, **mesh)
            changes |= {name: readers[name] for name in map("read_{}".format, changed_names)}
        return replace(self, **changes)

    def map_surface(self, change: Callable[[Surface], Surface]) -> "StoredFrames":
        """Return a copy with another surface, which `change` derives from the current one."""
        read = self.read_surface
        return replace(self, read_surface=lambda: change(read()))

    def read(self, start: int, stop: int) -> Vertices:
        """Read the positions of frames start..stop - 1, with the index rules of slices."""
        start, stop, _ = slice(start, stop).indices(self.n_frames)
        return self.read_range(start, max(start, stop))


def _mesh_readers(
    n_frames: int,
    n_verts: int,
    faces: Faces,
    surface: Surface,
    tracks: Mapping[str, TrackSource],
) -> dict[str, Any]:
    """Return the readers of `StoredFrames` for a mesh in memory; raises as its `replace`."""
    faces = frozen(validate_faces(faces, n_verts))
    surface = surface.validated(n_verts, faces)
    check_tracks(tracks, n_frames, n_verts, len(faces), surface)
    mesh = {"faces": faces, "surface": surface, "tracks": tracks}
    return {f"read_{name}": partial(identity, value) for name, value in mesh.items()}


def identity(value: Any) -> Any:
    """Return the value; unlike a lambda, a `partial` of this function can be pickled."""
    return value


def checksum(values: npt.NDArray[Any]) -> int:
    """Return a checksum that detects whether an array changes."""
    return zlib.crc32(np.ascontiguousarray(values).data)


class CheckedReader:
    """Reads frames of an array in a file, and checks that they stay the same.

    Parameters
    ----------
    read : function of a start and a stop
        Reads frames start..stop - 1; its errors name the file.
    """

    def __init__(self, path: Path, read: Callable[[int, int], npt.NDArray[Any]]) -> None:
        self._path, self._read = path, read
        self._checksums: dict[int, int] = {}

    def __call__(self, start: int, stop: int) -> npt.NDArray[Any]:
        """Read frames start..stop - 1; raises InvalidInputError if one has changed."""
        block = self._read(start, stop)
        for index, frame in enumerate(block, start):
            if self._checksums.setdefault(index, crc := checksum(frame)) != crc:
                raise changed_error(f"{self._path} (frame {index})")
        return block


def changed_error(location: str) -> InvalidInputError:
    """Error for a file whose contents differ from those that were read first."""
    return InvalidInputError(
        f"{location} changed after it was first read; start again, and do not change the files "
        "until it is done"
    )


@dataclass(frozen=True, eq=False)
class StoredTrack:
    """A `TrackSource` whose values are in files.

    Raises
    ------
    InvalidInputError
        If the kind does not allow the type or number of components.
    """

    domain: Domain
    kind: TrackKind
    unit: str
    dtype: np.dtype[Any]
    """One of `meshreel.model.tracks.NUMBER_TYPES`, in native byte order."""
    shape: tuple[int, int, int]
    """Numbers of frames, items and components: (T, N, C)."""
    read_range: Callable[[int, int], Values]
    """Reads the values of frames start..stop - 1, of shape (stop - start, N, C)."""

    def __post_init__(self) -> None:
        check_kind(self.kind, self.shape[2], self.dtype)

    def read(self, start: int, stop: int) -> Values:
        """Read the values of frames start..stop - 1, with the index rules of slices."""
        start, stop, _ = slice(start, stop).indices(self.shape[0])
        return self.read_range(start, max(start, stop))


def parse_track_kind(name: str, n_columns: int, dtype: np.dtype[Any]) -> TrackKind | None:
    """Return the track kind of a name; None if it is unknown or does not fit the values."""
    try:
        check_kind(kind := TrackKind(name), n_columns, dtype)
    except (ValueError, InvalidInputError):
        return None
    return kind


class FrameSurvey:
    """Accumulates the number type and extent of frames.

    Parameters
    ----------
    is_decimal : bool, default False
        Whether positions are decimal text without a declared type.
    """

    def __init__(self, *, is_decimal: bool = False) -> None:
        self._widest: np.dtype[np.floating] = np.dtype(np.float32)
        self._boxes: list[tuple[Corners, Corners]] = []
        self._narrowing = Narrowing() if is_decimal else None

    def add(self, vertices: Vertices) -> None:
        """Add frames: finite positions of shape (T, V, 3)."""
        self._widest = np.promote_types(self._widest, vertices.dtype)
        self._boxes.append(bounding_boxes(vertices))
        if self._narrowing is not None:
            for frame in vertices:
                self._narrowing.add(frame)

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """The widest type of the frames; float32 for decimal text if that is precise enough."""
        is_narrow = self._narrowing is not None and self._narrowing.is_harmless
        return np.dtype(np.float32) if is_narrow else self._widest

    @property
    def extent(self) -> Extent:
        """The extent of the frames in `dtype`."""
        # Rounding is monotonic, so the box of rounded positions is the rounded box.
        low, high = (
            np.concatenate(corners).astype(self.dtype).astype(np.float64)
            for corners in zip(*self._boxes, strict=True)
        )
        return extent_of_boxes(low, high)


BLOCK_BYTES = 1 << 24  # positions read at a time


@dataclass(frozen=True, eq=False)
class Description:
    """A sequence without its positions; fields as of `MeshSequence`."""

    faces: Faces
    name: str
    timing: Timing = UNTIMED
    surface: Surface = PLAIN
    error_bound: float | None = 0.0

    def sequence(self, vertices: Vertices, tracks: Mapping[str, Track]) -> MeshSequence:
        """Return the sequence with positions of shape (T, V, 3), a new array, and tracks."""
        vertices = hand_over(validate_vertices(vertices))
        return MeshSequence.of_finite(vertices, tracks=tracks, **vars(self))

    def stored_frames(
        self,
        shape: tuple[int, int],
        survey: FrameSurvey,
        read_range: Callable[[int, int], Vertices],
        files: Sequence[Path],
        tracks: Mapping[str, TrackSource],
    ) -> StoredFrames:
        """Return the sequence with frames in files; other parameters as in `StoredFrames`.

        Parameters
        ----------
        shape : tuple of int
            Numbers of frames and vertices.
        survey : FrameSurvey
            Survey of all frames.
        """
        n_frames, n_verts = shape
        return StoredFrames(
            n_frames=n_frames,
            n_verts=n_verts,
            dtype=survey.dtype,
            name=self.name,
            timing=self.timing,
            read_range=read_range,
            read_extent=partial(identity, survey.extent),
            files=tuple(files),
            error_bound=self.error_bound,
            **_mesh_readers(n_frames, n_verts, self.faces, self.surface, tracks),
        )

    def open(
        self,
        shape: tuple[int, int],
        dtype: np.dtype[np.floating],
        read: Callable[[int, int], Vertices],
        files: Sequence[Path],
        tracks: Mapping[str, TrackSource],
        max_loaded_bytes: int | None,
        progress: Progress = silent,
    ) -> FrameSource:
        """Return the sequence, loaded if it is small enough; reads all positions once.

        Parameters
        ----------
        shape : tuple of int
            Numbers of frames and vertices, at least 1.
        dtype : dtype
            float32 or float64. Type of the positions.
        read, files, tracks
            As in `StoredFrames`.
        max_loaded_bytes : int, optional
            Maximum size of positions and tracks to load. Default: no limit.

        Raises
        ------
        InvalidInputError
            If a position is not finite or the description does not fit.
        """
        n_frames, n_verts = shape
        frame_bytes = n_verts * 3 * dtype.itemsize
        total_bytes = n_frames * frame_bytes + sum(map(size_bytes, tracks.values()))
        is_loaded = max_loaded_bytes is None or total_bytes <= max_loaded_bytes
        vertices: Vertices = np.empty((n_frames * is_loaded, n_verts, 3), dtype)
        survey, block_frames = FrameSurvey(), max(1, BLOCK_BYTES // frame_bytes)
        for start in range(0, n_frames, block_frames):
            stop = min(start + block_frames, n_frames)
            block = read(start, stop)
            validate_finite(block, first_frame=start)
            if is_loaded:
                vertices[start:stop] = block
            else:
                survey.add(block)
            progress("reading", Count(stop, n_frames, "frames"))
        if is_loaded:
            return self.sequence(vertices, read_tracks(tracks))
        return self.stored_frames(shape, survey, read, files, tracks)

    def open_array(
        self,
        array: "RawArray",
        tracks: Mapping[str, TrackSource],
        max_loaded_bytes: int | None,
        progress: Progress,
    ) -> FrameSource:
        """Return the sequence as `open`, of positions that are an array in a file."""
        n_frames, n_verts, _ = array.shape
        shape, dtype = (n_frames, n_verts), array.dtype.newbyteorder("=")
        read, files = CheckedReader(array.path, array.read), [array.path]
        with errors_naming(array.path):
            return self.open(shape, dtype, read, files, tracks, max_loaded_bytes, progress)


@dataclass(frozen=True)
class RawArray:
    """An array of numbers in a file, in C order, whose first axis is frames."""

    path: Path
    start_byte: int
    """Offset in the file."""
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    """Type in the file, in any byte order."""

    def read(self, start: int, stop: int) -> npt.NDArray[Any]:
        """Read frames start..stop - 1, in native byte order.

        Raises
        ------
        InvalidInputError
            If the file has become shorter.
        """
        size = math.prod(self.shape[1:])
        offset = self.start_byte + start * size * self.dtype.itemsize
        with os_errors_naming(self.path):
            numbers = np.fromfile(self.path, self.dtype, (stop - start) * size, offset=offset)
        if len(numbers) < (stop - start) * size:
            raise changed_error(f"{self.path} (frame {start + len(numbers) // size})")
        return native(numbers).reshape(-1, *self.shape[1:])
