"""A `.reel` file whose frames are decoded on demand."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.codec.inspect import StreamInfo, stream_info
from meshreel.codec.joining import separate_stream
from meshreel.codec.memory import memory_limit
from meshreel.codec.methods import FrameReader
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.reel_track import (
    ReelTrack,
    decode_frames,
    modes_of_block,
    tracks_of_stream,
)
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import InvalidInputError
from meshreel.kernel.files import FileModes, OpenFile
from meshreel.model.frame_choice import FrameChoice, chosen_frames, frame_range
from meshreel.model.sequence import Faces
from meshreel.model.showing import notebook_html, show
from meshreel.model.surface import Surface
from meshreel.runtime.stores.ranged_file import RangedFile, with_own_position

Vertices = npt.NDArray[np.floating]

READ_AHEAD_BYTES, MIN_READ_AHEAD = 1 << 23, 16
"""Bytes, and least number, of frames that an iteration decodes at a time: the fields of large
meshes are gathered once for all of them."""


class ReelFile:
    """The frames of a `.reel` file, decoded on demand; returned by `meshreel.open`.

    ``len(reel)`` is the number of frames. ``reel[3]`` is the positions of a frame, of shape (V, 3);
    slices and lists of numbers return several frames; iteration yields all in constant memory.
    Threads may share it, and so may processes forked from the one that opened it.

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
        The same file, opened already.

    Attributes
    ----------
    n_frames, n_verts, n_faces : int
    fps : float
        0 = unknown.
    name : str
    start_s : float
        Time of the first frame, in seconds.
    dtype : numpy dtype
        Of the positions: float32 or float64.
    method : str
        Encoding method, as in `meshreel.encode`.
    order : str
        The kept order of vertices and faces: "keep" (both), "vertices" or "drop".
    frame : BoundingFrame
        Center and diagonal of the bounding box of the original frames; for a live recording, of
        the first block.
    starts : tuple of int
        First frame of each block, and the number of all frames.
    error_bound : float or None
        Guaranteed largest distance of vertices from the original, in model units, 0 if positions
        are lossless; None if the stream guarantees none, or only some modes are decoded.
    tracks : dict of str to ReelTrack
        Tracks by name.
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
    ) -> None:
        limit = memory_limit(memory)
        self._file = with_own_position(file)
        stream = self._opened = OpenStream(opened or self._file, limit, segment)
        stream.require_mesh()
        self._n_modes = n_modes
        if n_modes is not None:  # raise now if the stream does not support it
            _ = self._frames
        self.n_frames: int = stream.n_frames
        self.n_verts: int = stream.n_verts
        self.n_faces: int = stream.n_faces
        self.fps: float = stream.fps
        self.name: str = stream.name
        self.is_whole: bool = stream.is_whole
        self.dtype: np.dtype[np.floating] = stream.dtype
        self.start_s: float = stream.start_s
        self.frame: BoundingFrame = stream.frame
        percent = stream.error_bound_percent if n_modes is None else None
        self.error_bound: float | None = (
            None if percent is None else percent / 100 * self.frame.scale
        )
        self.starts: tuple[int, ...] = tuple(stream.starts)
        self.method: str = stream.method.name
        self.order = stream.order_kept.name.lower()

    @cached_property
    def _frames(self) -> FrameReader:
        """Decoder of frames, created on first use."""
        return self._opened.method.frames(self._opened, self._n_modes)

    @property
    def faces(self) -> Faces:
        """Vertex indices of each triangle, of shape (M, 3)."""
        return self._opened.faces

    @property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh."""
        return self._opened.surface

    @cached_property
    def tracks(self) -> dict[str, ReelTrack]:
        """Tracks by name."""
        return tracks_of_stream(self._opened, self._frames)

    def track(self, name: str) -> ReelTrack:
        """Return the track of this name, not decoded yet; raises InvalidInputError if missing."""
        if name in self.tracks:
            return self.tracks[name]
        tracks = f"choose {', '.join(self.tracks)}" if self.tracks else "it has no tracks"
        raise InvalidInputError(f"the file has no track {name!r}; {tracks}")

    def info(self) -> StreamInfo:
        """Describe the contents of the file, with bytes by section, without decoding a frame."""
        return stream_info(self._opened, is_remote=isinstance(self._file, RangedFile))

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
        if not 0 <= start <= stop <= self.n_frames:
            raise InvalidInputError(
                f"frames {start}:{stop} are not in the file; it has frames 0:{self.n_frames}"
            )
        self._opened.require_frames(range(start, stop))
        if start < stop:  # a damaged block raises before memory is allocated
            self.load(self._block_of(start))
        frames = np.empty((stop - start, self.n_verts, 3), self.dtype)
        self._frames.fill(frames, start)
        return frames

    def load(self, number: int) -> None:
        """Decode a block now, so that its frames are available without delay.

        Parameters
        ----------
        number : int
            In 0..len(starts) - 2.

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

    def __getitem__(self, chosen: FrameChoice) -> Vertices:
        """A frame of shape (V, 3), or frames of shape (T, V, 3)."""
        numbers = chosen_frames(chosen, self.n_frames)
        if isinstance(numbers, int):
            return np.asarray(self.read(numbers, numbers + 1)[0])
        if isinstance(numbers, range) and numbers.step == 1:
            return self.read(numbers.start, max(numbers.start, numbers.stop))
        return self.frames(np.asarray(numbers, np.int64))

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
        return decode_frames(self._opened, self._frames, 0, numbers, out)

    def modes(self, block: int) -> FileModes | None:
        """Return the fields and basis vectors of a block, to compute its frames elsewhere.

        Parameters
        ----------
        block : int
            In 0..len(starts) - 2.

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
        return modes_of_block(self._frames, block, 0)

    @property
    def cached_bytes(self) -> int:
        """Memory of the mesh and of decoded blocks, except for the paper's methods."""
        return self._opened.file.held_bytes

    def __iter__(self) -> Iterator[Vertices]:
        for _, frames in self.pieces():
            yield from frames

    def pieces(self, selected: range | None = None) -> Iterator[tuple[int, Vertices]]:
        """Yield runs of frames: number of the first, and positions of shape (T_run, V, 3).

        Parameters
        ----------
        selected : range, optional
            Consecutive frames; default all.
        """
        frames = range(self.n_frames) if selected is None else selected
        starts = self.starts
        frame_bytes = self.n_verts * 3 * self.dtype.itemsize
        n_together = max(MIN_READ_AHEAD, READ_AHEAD_BYTES // frame_bytes)
        n_together = max(1, min(n_together, int(self._opened.limit.limit_bytes // frame_bytes)))
        first, last = self._block_of(frames.start), self._block_of(frames.stop - 1)
        for number in range(first, last + 1):
            start, stop = max(frames.start, starts[number]), min(frames.stop, starts[number + 1])
            for run in range(start, stop, n_together):
                yield run, self.read(run, min(run + n_together, stop))

    def frame_range(self, chosen: slice | None) -> range:
        """Return the frames of a slice (None: all); raises InvalidInputError if not consecutive."""
        return frame_range(chosen, self.n_frames)

    def require_frames(self, frames: range) -> None:
        """Raise MemoryLimitError if these frames and their tracks exceed the memory limit."""
        self._opened.require_frames(frames, with_tracks=True)

    def n_modes_of(self, number: int) -> int:
        """Read the number of modes of a block, without decoding it.

        Raises
        ------
        CorruptStreamError
            If the block is damaged.
        """
        return self._opened.file.group(number).n_modes

    @cached_property
    def _segment(self) -> bytes | None:
        """A stream of this segment, if the file has several."""
        return separate_stream(self._opened) if self._opened.file.whole.n_segments > 1 else None

    @property
    def size_bytes(self) -> int:
        """Size of the stream up to its end or last complete block."""
        return self._opened.size_bytes if self._segment is None else len(self._segment)

    def stored(self, start: int, stop: int) -> bytes:
        """Return stored bytes of the stream, for servers.

        If the file has several segments, they are of a stream of this segment, kept in memory.
        """
        if self._segment is not None:
            return self._segment[start:stop]
        return self._opened.file.bytes_at(start, max(0, min(stop, self.size_bytes) - start))

    @property
    def files(self) -> tuple[Path, ...]:
        """Path of the file, if it has one."""
        name = getattr(self._file, "name", None)
        return (Path(name),) if isinstance(name, str | Path) else ()

    def close(self) -> None:
        """Close the file and release decoded blocks."""
        if "_frames" in self.__dict__:
            self._frames.close()
        self._file.close()

    def __enter__(self) -> "ReelFile":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    _repr_html_ = notebook_html
    show = show

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        cut = "" if self.is_whole else ", cut off"
        return (
            f"<ReelFile{name}: {self.n_frames} frames, {self.n_verts} vertices, "
            f"{self.n_faces} faces, {self.fps:g} fps, {self.dtype}{cut}>"
        )

    def _block_of(self, frame: int) -> int:
        """Return the block that contains a frame."""
        return int(np.searchsorted(self.starts, frame, side="right")) - 1
