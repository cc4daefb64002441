"""A `.reel` file of several segments whose frames are decoded on demand."""

import os
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from meshreel.codec.inspect import StreamInfo, file_info
from meshreel.codec.memory import memory_limit
from meshreel.codec.open_stream import require_whole
from meshreel.codec.reel_file import ReelFile
from meshreel.kernel.files import OpenFile
from meshreel.model.frame_choice import chosen_frames
from meshreel.model.segments import MeshFrame, frame_at
from meshreel.runtime.counting import counted
from meshreel.runtime.stores.ranged_file import RangedFile, with_own_position
from meshreel.runtime.threads import fork_safe_lock

MAX_OPEN_SEGMENTS = 4
"""Segments that stay decoded: enough to play across a boundary, and to go back."""


class SegmentedReelFile:
    """The frames of a `.reel` file with several segments; returned by `meshreel.open_segments`.

    Its length is the number of frames of all segments. ``reel[3]`` is a `MeshFrame`: positions and
    faces; iterating gives all frames in turn in constant memory.

    Parameters
    ----------
    file : binary file that can seek
        Closed together with this object.
    n_modes, memory
        As in `meshreel.open`.

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
    is_whole : bool
        As of `ReelFile`.
    """

    def __init__(
        self,
        file: BinaryIO,
        n_modes: int | None = None,
        memory: float | str | None = None,
    ) -> None:
        self._file = with_own_position(file)
        self._n_modes, self._memory = n_modes, memory
        self._limit = memory_limit(memory)
        self._opened = OpenFile(self._file, self._limit.limit_bytes)
        self._segments: OrderedDict[int, ReelFile] = OrderedDict()
        self._lock = fork_safe_lock()
        info = self._opened.info
        self.n_frames: int = info.n_frames
        self.n_segments: int = info.n_segments
        self.fps: float = info.fps
        self.name: str = info.name
        self.start_s: float = info.start_s
        self.is_whole: bool = info.is_whole
        first_frames = (segment.first_frame for segment in self._opened.segments)
        self.starts: tuple[int, ...] = (*first_frames, info.n_frames)
        self.segment(0)  # raises now if n_modes is not supported or the mesh is too large

    def segment(self, number: int) -> ReelFile:
        """Return a segment, whose frames count from 0; it stays open as long as this file.

        Raises
        ------
        InvalidInputError
            If there is no such segment.
        CorruptStreamError
            If it is damaged.
        """
        with self._lock:
            if number not in self._segments:
                reel = ReelFile(
                    self._file, self._n_modes, self._memory, number, opened=self._opened
                )
                self._segments[number] = reel
                if len(self._segments) > MAX_OPEN_SEGMENTS:
                    self._segments.popitem(last=False)
            self._segments.move_to_end(number)
            return self._segments[number]

    def frame(self, number: int) -> MeshFrame:
        """Return a frame of 0..T-1; only its block is decoded."""
        return frame_at(self, number)

    def __len__(self) -> int:
        return self.n_frames

    def __getitem__(self, chosen: int) -> MeshFrame:
        numbers = chosen_frames(chosen, self.n_frames)
        if not isinstance(numbers, int):
            raise TypeError(
                "frames of a file with several segments are chosen by a number; "
                "meshreel.decode(..., frames=slice) decodes a range"
            )
        return self.frame(numbers)

    def __iter__(self) -> Iterator[MeshFrame]:
        for number in range(self.n_segments):
            reel = self.segment(number)
            for vertices in reel:
                yield MeshFrame(vertices, reel.faces)

    def info(self) -> StreamInfo:
        """Return the contents of the file and the bytes of each part; decodes no frame."""
        is_remote = isinstance(self._file, RangedFile)
        return file_info(self._opened, limit=self._limit, is_remote=is_remote)

    def require_whole(self) -> None:
        """Raise CorruptStreamError or TruncatedStreamError if the end is missing or damaged."""
        require_whole(self._opened, self._file.seek(0, os.SEEK_END))

    def require_memory(self, needed_bytes: int) -> None:
        """Raise MemoryLimitError if its decoded segments exceed the memory limit of this file."""
        self._limit.require(needed_bytes, f"all {self.n_frames} frames of {self!r}")

    @property
    def size_bytes(self) -> int:
        """Size of the file up to its end or last complete block."""
        return self._opened.info.size_bytes

    def stored(self, start: int, stop: int) -> bytes:
        """Return stored bytes of the file with all its segments, for servers."""
        return self._opened.bytes_at(start, max(0, min(stop, self.size_bytes) - start))

    @property
    def files(self) -> tuple[Path, ...]:
        """The file that frames are read from, if it has a name."""
        name = getattr(self._file, "name", None)
        return (Path(name),) if isinstance(name, str | Path) else ()

    def close(self) -> None:
        """Close the file and release what is decoded."""
        self._segments.clear()
        self._opened.close()
        self._file.close()

    def __enter__(self) -> "SegmentedReelFile":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        truncated = "" if self.is_whole else ", incomplete"
        return (
            f"<SegmentedReelFile{name}: {self.n_frames} frames in "
            f"{counted(self.n_segments, 'segment')}, {self.fps:g} fps{truncated}>"
        )
