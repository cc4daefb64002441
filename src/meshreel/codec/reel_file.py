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
from meshreel.codec.reel_track import ReelTrack, tracks_of_stream
from meshreel.errors import InvalidInputError
from meshreel.model.frame_choice import FrameChoice, chosen_frames, frame_range
from meshreel.model.sequence import Faces
from meshreel.model.showing import notebook_html, show
from meshreel.model.surface import Surface
from meshreel.runtime.stores.positional_file import with_own_position
from meshreel.runtime.stores.ranged_file import RangedFile

Vertices = npt.NDArray[np.floating]

READ_AHEAD_BYTES, LEAST_TOGETHER = 1 << 23, 16
"""Size of the frames that an iteration decodes at a time, and how many there are at least: the
fields of large meshes are collected once for all of them."""


class ReelFile:
    """The frames of a `.reel` file, decoded on demand; returned by `meshreel.open`.

    Its length is the number of frames. ``reel[3]`` is the positions of a frame, of shape (V, 3); a
    slice, or a list of numbers, gives those of several; iterating gives all in turn in constant
    memory. Several threads may share one, and so may
    processes forked from the one that opened it.

    Parameters
    ----------
    file : binary file that can seek
        Closed together with this object.
    n_modes : int, optional
        As in `meshreel.open`.
    memory : float or str, optional
        As in `meshreel.open`.
    segment : int, optional
        As in `meshreel.open`; frames, and all else, are then of this segment.

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
        How it was coded, as `meshreel.encode` calls it.
    order : str
        The order of vertices and faces that is kept: "keep" (all), "vertices" or "drop".
    frame : BoundingFrame
        Centre and diagonal of the bounding box of the original frames; of a live recording, of
        those of the first block.
    starts : tuple of int
        First frame of each block, and the number of all frames.
    promised_error : float or None
        Upper bound of the distance of vertices from the original, in model units, 0 if positions
        come back bit for bit; None if the stream has none, or only some of its modes are decoded.
    tracks : dict of str to ReelTrack
        Quantities that change over time, beside the positions, by their names.
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
    ) -> None:
        limit = memory_limit(memory)
        self._file = with_own_position(file)
        opened = self._opened = OpenStream(self._file, limit, segment)
        opened.require_mesh()
        self._n_modes = n_modes
        if n_modes is not None:  # which may not be for this stream: that is said now
            _ = self._frames
        self.n_frames, self.n_verts, self.n_faces = opened.n_frames, opened.n_verts, opened.n_faces
        self.fps, self.name, self.is_whole = opened.fps, opened.name, opened.is_whole
        self.dtype = opened.dtype
        self.start_s, self.frame = opened.start_s, opened.frame
        promised = opened.promise_percent if n_modes is None else None
        self.promised_error = None if promised is None else promised / 100 * self.frame.scale
        self.starts = tuple(opened.starts)
        self.method = opened.method.name
        self.order = opened.order_kept.name.lower()

    @cached_property
    def _frames(self) -> FrameReader:
        """The decoder of its frames, which a file that is only described does not need."""
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
        """Quantities that change over time, beside the positions, by their names."""
        return tracks_of_stream(self._opened, self._frames)

    def track(self, name: str) -> ReelTrack:
        """A track of this name, of which nothing is decoded yet.

        Raises
        ------
        InvalidInputError
            If there is none; says which there are.
        """
        if name in self.tracks:
            return self.tracks[name]
        there = f"there are {', '.join(self.tracks)}" if self.tracks else "it has none"
        raise InvalidInputError(f"the file has no track {name!r}; {there}")

    def info(self) -> StreamInfo:
        """Contents of the file and bytes by section; no frame is decoded."""
        return stream_info(self._opened, is_remote=isinstance(self._file, RangedFile))

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3).

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
        if start < stop:  # raises for a damaged one before memory is allocated
            self.load(self._number_of(start))
        frames = np.empty((stop - start, self.n_verts, 3), self.dtype)
        self._frames.fill(frames, start)
        return frames

    def load(self, number: int) -> None:
        """Decode a block now, so that its frames come without delay.

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
        # In the order of the file, so that no block is decoded twice.
        in_order, places = np.unique(np.asarray(numbers, np.int64), return_inverse=True)
        self._opened.require_frames(range(len(in_order)))
        frames = np.empty((len(in_order), self.n_verts, 3), self.dtype)
        for place, number in enumerate(in_order.tolist()):
            frames[place] = self.read(number, number + 1)[0]
        return frames[places]

    def __iter__(self) -> Iterator[Vertices]:
        for _, frames in self.pieces():
            yield from frames

    def pieces(self, wanted: range | None = None) -> Iterator[tuple[int, Vertices]]:
        """Runs of frames: number of the first, and positions of shape (T_run, V, 3).

        Parameters
        ----------
        wanted : range, optional
            Consecutive frames; default all.
        """
        frames = range(self.n_frames) if wanted is None else wanted
        starts = self.starts
        frame_bytes = self.n_verts * 3 * self.dtype.itemsize
        n_together = max(LEAST_TOGETHER, READ_AHEAD_BYTES // frame_bytes)
        n_together = max(1, min(n_together, int(self._opened.limit.limit_bytes // frame_bytes)))
        first, last = self._number_of(frames.start), self._number_of(frames.stop - 1)
        for number in range(first, last + 1):
            start, stop = max(frames.start, starts[number]), min(frames.stop, starts[number + 1])
            for run in range(start, stop, n_together):
                yield run, self.read(run, min(run + n_together, stop))

    def frame_range(self, chosen: slice | None) -> range:
        """The frames of a slice of consecutive frames; None is all.

        Raises
        ------
        InvalidInputError
            If it has no frame, or its frames are not consecutive.
        """
        return frame_range(chosen, self.n_frames)

    def require_frames(self, frames: range) -> None:
        """Raise MemoryLimitError if these frames and their tracks exceed the memory limit."""
        self._opened.require_frames(frames, with_tracks=True)

    def n_modes_of(self, number: int) -> int:
        """Number of modes of a block; it is read, and not decoded.

        Raises
        ------
        CorruptStreamError
            If the block is damaged.
        """
        return self._opened.file.group(number).n_modes

    @cached_property
    def _segment(self) -> bytes | None:
        """A stream of the segment that is open, if the file has several."""
        return separate_stream(self._opened) if self._opened.file.whole.n_segments > 1 else None

    @property
    def size_bytes(self) -> int:
        """Size of the stream, without what may follow its last complete block."""
        return self._opened.size_bytes if self._segment is None else len(self._segment)

    def stored(self, start: int, stop: int) -> bytes:
        """Bytes of the stream as they are stored, such as a server sends them.

        Those of a segment of several are a stream of this segment alone, which is kept in memory.
        """
        if self._segment is not None:
            return self._segment[start:stop]
        return self._opened.file.bytes_at(start, max(0, min(stop, self.size_bytes) - start))

    @property
    def files(self) -> tuple[Path, ...]:
        """The file that frames are read from, if it has a name."""
        name = getattr(self._file, "name", None)
        return (Path(name),) if isinstance(name, str | Path) else ()

    def close(self) -> None:
        """Close the file and release what is decoded."""
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

    def _number_of(self, frame: int) -> int:
        """The block that holds a frame."""
        return int(np.searchsorted(self.starts, frame, side="right")) - 1
