"""Writing of HDF5 files that survives a full disk.

The HDF5 library crashes if it cannot flush its buffers. It gets a file object that accepts all
writes: data that the disk refuses stays in memory, and the error is raised after the library has
closed the file.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.arrays import Values
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.hdf.reading import Node
from meshreel.model.sequence import Vertices
from meshreel.model.tracks import TrackSource, track_blocks
from meshreel.runtime.extras import HDF


class DeferredErrorFile(io.RawIOBase):
    """A file that accepts all writes; `check` raises the first error of the disk.

    Parameters
    ----------
    file : io.FileIO
        Open for reading and writing.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self._place = 0
        self._refused: list[tuple[int, bytes]] = []
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error of the first failed write, if any.

        Raises
        ------
        OSError
        """
        if self._error is not None:
            raise self._error

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Write bytes; keep those that the disk refuses."""
        left = memoryview(data).cast("B")
        n_bytes = len(left)
        try:
            self._file.seek(self._place)
            while left:
                n_written = self._file.write(left) or 0
                left, self._place = left[n_written:], self._place + n_written
        except OSError as error:
            self._error = self._error or error
            self._refused.append((self._place, bytes(left)))
            self._place += len(left)
        return n_bytes

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read back written bytes; zeros where nothing was written."""
        self._file.seek(self._place)
        n_read = self._file.readinto(buffer) or 0
        buffer[n_read:] = bytes(len(buffer) - n_read)
        for start, data in self._refused:
            first, last = max(start, self._place), min(start + len(data), self._place + len(buffer))
            if first < last:
                part = data[first - start : last - start]
                buffer[first - self._place : last - self._place] = part
        self._place += len(buffer)
        return len(buffer)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to an offset in the file."""
        ends = [start + len(data) for start, data in self._refused]
        size = max([self._file.seek(0, io.SEEK_END), *ends])
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: size}[whence]
        return self._place

    def tell(self) -> int:
        """Return the offset in the file."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Truncate the file, or extend it by zeros."""
        length = self._place if size is None else size
        try:
            self._file.truncate(length)
        except OSError as error:
            self._error = self._error or error
        return length


class HdfOutput:
    """An HDF5 file that is being written.

    Attributes
    ----------
    root : Node
        Its root group.
    """

    def __init__(self, root: Node, file: DeferredErrorFile) -> None:
        self.root = root
        self._file = file

    def frames(self, stream: FrameStream) -> Iterator[tuple[int, Vertices]]:
        """Yield number and positions of each frame; raises when the disk is full."""
        for numbered in enumerate(stream.frames()):
            self._file.check()
            yield numbered

    def blocks(self, track: TrackSource) -> Iterator[tuple[int, Values]]:
        """Yield blocks of frames of a track's values, with the number of their first frame."""
        for block in track_blocks(track):
            self._file.check()
            yield block


@contextmanager
def hdf_output(path: Path) -> Iterator[HdfOutput]:
    """Create an HDF5 file that is complete when the block ends.

    Raises
    ------
    FormatError
        If h5py is not installed.
    OSError
        If writing fails, for example because the disk is full.
    """
    h5py = HDF.load()
    with path.open("w+b", buffering=0) as raw:
        file = DeferredErrorFile(raw)
        with h5py.File(file, "w") as root:
            yield HdfOutput(root, file)
        file.check()
