"""A `.reel` file whose frames are decoded on demand."""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, BinaryIO, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Vertices
from meshreel.codec.inspect import StreamInfo, file_info
from meshreel.codec.joining import separate_stream
from meshreel.codec.memory import memory_limit
from meshreel.codec.methods import FrameReader, method_named
from meshreel.codec.open_stream import OpenStream, require_positions, require_whole, timing_of
from meshreel.codec.reel_track import DecodedValues, ReelTrack
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.kernel.files import FileModes, OpenFile
from meshreel.model.frame_choice import frame_range
from meshreel.model.labeled_arrays import track_dataset
from meshreel.model.sequence import (
    Faces,
    MeshFrame,
    MeshSequence,
    frame_of,
    frames_by_segment,
    frames_of,
)
from meshreel.model.showing import notebook_html, show
from meshreel.model.surface import Surface
from meshreel.model.timing import Timed, Timing
from meshreel.model.tracks import track_by_name
from meshreel.model.validation import hand_over
from meshreel.runtime.counting import counts_text
from meshreel.runtime.stores.ranged_file import RangedFile
from meshreel.runtime.threads import fork_safe_lock

READ_AHEAD_BYTES, MIN_READ_AHEAD = 1 << 23, 16
"""Size, and minimum number, of frames that an iteration decodes at a time, because each read
gathers the fields of a mesh."""

MAX_OPEN_SEGMENTS = 4
"""Maximum number of decoded segments: enough to play across a boundary, and to go back."""


class ReelFile(Timed):
    """The frames of a `.reel` file, decoded on demand; returned by `meshreel.open`.

    ``len(reel)`` is the number of frames. ``reel[3]`` is a `MeshFrame`, positions and faces; a
    slice is decoded to a `MeshSequence`; iteration yields all frames in constant memory. Threads
    may share it, and so may processes forked from the one that opened it. A file that was opened
    by its path or address can be pickled; it is opened again where it is unpickled.

    A file of several segments has `segments`, each of which is a `ReelFile` of constant
    connectivity; attributes of a single segment, such as `faces` and `read`, raise
    ConnectivityChangeError for the whole file.

    Parameters
    ----------
    file : binary file that can seek
        Closed together with this object.
    n_modes : int, optional
        As in `meshreel.open`.
    memory : float or str, optional
        As in `meshreel.open`.
    segment : int, optional
        As in `meshreel.open`; frames and all attributes are then of this segment.
    opened : OpenFile, optional
        The same file, already open.
    reopen : callable, optional
        Opens the file again, with a keyword `segment`.

    Attributes
    ----------
    n_frames, n_segments : int
    starts : tuple of int
        First frame of each segment, and the number of all frames.
    fps : float
        0 = unknown.
    name : str
    start_s : float
        Time of the first frame, in seconds.
    times : float64 array of shape (T,), or None
        Time of each frame, in seconds; None if the frame rate is unknown.
    timing : Timing
        All of these.
    is_whole : bool
        False if the end of the file is missing: its encoder was interrupted, or is still running.
        The frames of all complete blocks are available.
    """

    def __init__(
        self,
        file: BinaryIO,
        n_modes: int | None = None,
        memory: float | str | None = None,
        segment: int | None = None,
        *,
        opened: OpenFile | None = None,
        reopen: "Callable[..., ReelFile] | None" = None,
    ) -> None:
        self._limit = memory_limit(memory)
        self._file = file
        self._n_modes, self._memory, self._number = n_modes, memory, segment
        self._reopen = reopen
        self._whole = opened or OpenFile(self._file, self._limit.limit_bytes)
        self._decoded: OrderedDict[int, ReelFile] = OrderedDict()
        self._lock = fork_safe_lock()
        self._only: OpenStream | None = None
        info = self._whole.info
        if segment is None and info.n_segments > 1:
            first_frames = (entry.first_frame for entry in self._whole.segments)
            self.starts: tuple[int, ...] = (*first_frames, info.n_frames)
            self.timing: Timing = timing_of(self._whole)
            self._segment(0)  # raises now if n_modes is not supported
        else:
            self._only = OpenStream(self._whole, self._limit, segment)
            self.starts = 0, self._only.n_frames
            self.timing = self._only.timing
            if n_modes is not None:  # raise now if the stream does not support it
                _ = self._frames
        self.n_frames: int = self.starts[-1]
        self.n_segments: int = len(self.starts) - 1
        self.name: str = info.name
        self.is_whole: bool = info.is_whole if self._only is None else self._only.is_whole

    @property
    def segments(self) -> "Sequence[ReelFile]":
        """Segments, whose frames count from 0; opened on access, and open as long as this file.

        A few segments stay decoded; a caller that keeps none needs memory only for these.
        """
        return (self,) if self._only is not None else _Segments(self)

    def _segment(self, number: int) -> "ReelFile":
        with self._lock:
            if number not in self._decoded:
                part = partial(ReelFile, self._file, self._n_modes, self._memory, number)
                self._decoded[number] = part(opened=self._whole, reopen=self._reopen)
                if len(self._decoded) > MAX_OPEN_SEGMENTS:
                    self._decoded.popitem(last=False)
            self._decoded.move_to_end(number)
            return self._decoded[number]

    @property
    def _opened(self) -> OpenStream:
        """The stream of the only segment."""
        if self._only is None:
            raise ConnectivityChangeError(
                f"the faces change: {self!r}; use one of its segments, such as reel.segments[0]"
            )
        return self._only

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return self._opened.n_verts

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the positions, (T, V, 3)."""
        return self.n_frames, self.n_verts, 3

    @property
    def n_faces(self) -> int:
        """Number of triangles, M."""
        return self._opened.n_faces

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions: float32 or float64."""
        return self._opened.dtype

    @property
    def frame(self) -> BoundingFrame:
        """Center and diagonal of the bounding box of the original frames.

        For a live recording, of the first block.
        """
        return self._opened.frame

    @property
    def method(self) -> str:
        """Encoding method, as in `meshreel.encode`."""
        return self._opened.method

    @property
    def order(self) -> str:
        """The kept order of vertices and faces: "keep" (both), "vertices" or "drop"."""
        return self._opened.order_kept.name.lower()

    @property
    def block_starts(self) -> tuple[int, ...]:
        """First frame of each block, and the number of all frames."""
        return tuple(self._opened.starts)

    @property
    def error_bound(self) -> float | None:
        """Guaranteed largest distance of vertices from the original, in model units.

        0 if positions are those of the original; None if the stream guarantees none, or only some
        modes are decoded.
        """
        return self._opened.error_bound if self._n_modes is None else None

    @cached_property
    def _frames(self) -> FrameReader:
        """Decoder of frames, created on first use."""
        return method_named(self._opened.method).frames(self._opened, self._n_modes)

    @cached_property
    def _positions(self) -> DecodedValues:
        return DecodedValues(self._opened, self._frames, 0)

    @property
    def faces(self) -> Faces:
        """Vertex indices of each triangle, of shape (M, 3)."""
        return self._opened.file.faces

    @property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh."""
        return self._opened.surface

    @cached_property
    def tracks(self) -> dict[str, ReelTrack]:
        """Tracks by name."""
        tracks = (
            ReelTrack(self._opened, self._frames, number)
            for number, _ in enumerate(self._opened.tracks, start=1)
        )
        return {track.name: track for track in tracks}

    def track(self, name: str) -> ReelTrack:
        """Return the track of this name, not decoded yet; raises KeyError if missing."""
        return track_by_name(self.tracks, name)

    def to_xarray(self) -> Any:
        """Decode all tracks into an ``xarray.Dataset``, as `MeshSequence.to_xarray`."""
        return track_dataset(self.tracks, self.times)

    def info(self) -> StreamInfo:
        """Describe the contents of the file, with bytes by section; decodes at most a frame."""
        is_remote = isinstance(self._file, RangedFile)
        return file_info(self._whole, self._number, self._limit, is_remote=is_remote)

    def require_whole(self) -> None:
        """Raise CorruptStreamError or TruncatedStreamError if the end is missing or damaged."""
        require_whole(self._whole)

    def read(self, start: int, stop: int) -> Vertices:
        """Decode positions of frames start..stop - 1, of shape (stop - start, V, 3).

        Raises
        ------
        InvalidInputError
            If these frames do not exist.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If these frames, or a block, take more memory than allowed.
        """
        return self._positions.read(start, stop)

    def load(self, number: int) -> None:
        """Decode a block now, so that its frames are available without delay.

        Parameters
        ----------
        number : int
            In 0..len(block_starts) - 2.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        MemoryLimitError
            If it takes more memory than allowed.
        """
        self._frames.load(number)

    def __len__(self) -> int:
        return self.n_frames

    @overload
    def __getitem__(self, index: SupportsIndex) -> MeshFrame: ...

    @overload
    def __getitem__(self, index: slice) -> MeshSequence: ...

    def __getitem__(self, index: SupportsIndex | slice) -> MeshFrame | MeshSequence:
        """Decode a frame, or the frames of a slice, with their tracks.

        Raises
        ------
        IndexError, InvalidInputError
            If a frame does not exist, or the slice selects none.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If the frames, or a block, take more memory than allowed.
        """
        if not isinstance(index, slice):
            return frame_of(self.segments, self.starts, index)
        selected = frame_range(index, self.n_frames)
        parts, decoded_bytes, n_done = [], 0, 0
        timing = self.timing.part(selected)
        selections = [*frames_by_segment(self.starts, selected)]
        if len(selections) > 1:
            require_positions(self._whole, self._limit, selections, selected)
        for number, frames in selections:
            segment = self.segments[number]
            segment._opened.require_frames(frames, self._n_modes)
            frames_bytes = len(frames) * segment.n_verts * 3 * segment.dtype.itemsize
            subject = f"frames {selected.start}:{selected.stop} of {self!r}"
            self._limit.require(decoded_bytes + frames_bytes, subject)
            own_timing = timing.part(range(n_done, n_done + len(frames)))
            parts.append(frames_of(segment, frames, own_timing, hand_over))
            n_done += len(frames)
            decoded_bytes += parts[-1].raw_size_bytes
        return MeshSequence.of_segments(parts, self.name, timing)

    def frames(self, numbers: npt.ArrayLike, out: Vertices | None = None) -> Vertices:
        """Decode positions of several frames, such as the windows of a batch.

        Each block is decoded once. Runs of consecutive numbers are computed together, so windows
        are faster than single frames.

        Parameters
        ----------
        numbers : integers of any shape
            Negative numbers count from the end; numbers may be repeated.
        out : contiguous array, optional
            Array to fill and return: of the shape of the result, and of the type of the file.

        Returns
        -------
        array of shape (..., V, 3)
            With the shape of `numbers` in front.

        Raises
        ------
        IndexError
            If a frame does not exist.
        InvalidInputError
            If `out` has another shape or type, or is not contiguous.
        CorruptStreamError
            If a block is damaged.
        MemoryLimitError
            If the result, or a block, takes more memory than allowed.
        """
        return self._positions.frames(numbers, out)

    def modes(self, block: int) -> FileModes | None:
        """Return the fields and basis vectors of a block, to compute its frames elsewhere.

        Parameters
        ----------
        block : int
            In 0..len(block_starts) - 2.

        Returns
        -------
        FileModes or None
            None if positions are not a sum of modes: those of lossless and `grid` streams, and of
            the paper's methods.

        Raises
        ------
        CorruptStreamError
            If the block is damaged.
        MemoryLimitError
            If it takes more memory than allowed.
        """
        return self._positions.modes(block)

    @property
    def cached_bytes(self) -> int:
        """Memory of the mesh and of decoded blocks, except for the paper's methods."""
        return self._opened.file.memory_bytes

    def __iter__(self) -> Iterator[MeshFrame]:
        for segment in self.segments:
            faces = segment.faces
            for _, frames in segment.pieces():
                yield from (MeshFrame(vertices, faces) for vertices in frames)

    def pieces(self, selected: range | None = None) -> Iterator[tuple[int, Vertices]]:
        """Yield runs of frames: number of the first, and positions of shape (T_run, V, 3).

        Parameters
        ----------
        selected : range, optional
            Consecutive frames; default all.
        """
        frames = range(self.n_frames) if selected is None else selected
        starts = self.block_starts
        frame_bytes = self.n_verts * 3 * self.dtype.itemsize
        n_per_read = max(MIN_READ_AHEAD, READ_AHEAD_BYTES // frame_bytes)
        n_per_read = max(1, min(n_per_read, int(self._opened.limit.limit_bytes // frame_bytes)))
        for block, numbers in frames_by_segment(starts, frames):
            start, stop = starts[block] + numbers.start, starts[block] + numbers.stop
            for run in range(start, stop, n_per_read):
                yield run, self.read(run, min(run + n_per_read, stop))

    @cached_property
    def _separated(self) -> bytes | None:
        """A stream of this segment, if the file has several."""
        is_part = self._only is not None and self._only.file.whole.n_segments > 1
        return separate_stream(self._opened) if is_part else None

    @property
    def size_bytes(self) -> int:
        """Size of the stream up to its end or last complete block."""
        if self._separated is not None:
            return len(self._separated)
        return self._whole.info.size_bytes

    def stored(self, start: int, stop: int) -> bytes:
        """Return bytes start..stop - 1 of the stream, for servers.

        For a segment of several, the stream contains this segment alone, and is kept in memory.
        """
        if self._separated is not None:
            return self._separated[start:stop]
        return self._whole.bytes_at(start, max(0, min(stop, self.size_bytes) - start))

    @property
    def files(self) -> tuple[Path, ...]:
        """Path of the file, if it has one."""
        name = getattr(self._file, "name", None)
        return (Path(name),) if isinstance(name, str | Path) else ()

    def close(self) -> None:
        """Close the file and release decoded blocks."""
        self._decoded.clear()
        if "_frames" in self.__dict__:
            self._frames.close()
        if self._only is not None:
            self._only.file.close()
        self._whole.close()
        self._file.close()

    def __reduce__(self) -> tuple[Any, ...]:
        if self._reopen is None:
            raise InvalidInputError(
                "a ReelFile of bytes or of a file object cannot be pickled; open it by its path, "
                "meshreel.open('walk.reel'), or pickle the bytes"
            )
        return partial(self._reopen, segment=self._number), ()

    def __enter__(self) -> "ReelFile":
        return self

    def __exit__(self, *details: object) -> None:
        self.close()

    _repr_html_ = notebook_html
    show = show

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        cut = "" if self.is_whole else ", cut off"
        if self._only is None:
            mesh = f"{self.n_frames} frames in {self.n_segments} segments, {self.fps:g} fps"
        else:
            counts = counts_text(frame=self.n_frames, vertex=self.n_verts, face=self.n_faces)
            mesh = f"{counts}, {self.fps:g} fps, {self.dtype}"
        return f"<ReelFile{name}: {mesh}{cut}>"


class _Segments(Sequence[ReelFile]):
    """The segments of a file, opened on access."""

    def __init__(self, whole: ReelFile) -> None:
        self._whole = whole

    def __len__(self) -> int:
        return len(self._whole.starts) - 1

    @overload
    def __getitem__(self, number: int) -> ReelFile: ...

    @overload
    def __getitem__(self, number: slice) -> list[ReelFile]: ...

    def __getitem__(self, number: int | slice) -> ReelFile | list[ReelFile]:
        """Return a segment; raises CorruptStreamError if it is damaged."""
        numbers = range(len(self))[number]
        if isinstance(numbers, range):
            return [self._whole._segment(index) for index in numbers]
        return self._whole._segment(numbers)
