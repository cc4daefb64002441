"""HDF5 files that are written, also where the disk may become full.

The HDF5 library crashes when it cannot write all that it holds back. It is given a file that takes
everything: what the disk refuses is kept in memory until the library is done, and told then.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from meshreel.arrays import Values
from meshreel.formats.extras import HDF
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.hdf.reading import Node
from meshreel.model.sequence import Vertices
from meshreel.model.tracks import TrackSource, track_blocks


class PatientFile(io.RawIOBase):
    """A file that never fails to write while it is open; `check` says whether it has.

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
        """Raise what the system said when it first refused to write.

        Raises
        ------
        OSError
        """
        if self._error is not None:
            raise self._error

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Write bytes, or keep those that the disk refuses."""
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
        """Read back what was written; zeros where nothing was."""
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
        """Go to a place in the file."""
        ends = [start + len(data) for start, data in self._refused]
        size = max([self._file.seek(0, io.SEEK_END), *ends])
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: size}[whence]
        return self._place

    def tell(self) -> int:
        """The place in the file."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """Cut the file, or make it longer by zeros."""
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

    def __init__(self, root: Node, file: PatientFile) -> None:
        self.root = root
        self._file = file

    def frames(self, stream: FrameStream) -> Iterator[tuple[int, Vertices]]:
        """Number and positions of each frame, as long as the disk takes them."""
        for numbered in enumerate(stream.frames()):
            self._file.check()
            yield numbered

    def blocks(self, track: TrackSource) -> Iterator[tuple[int, Values]]:
        """Values of a track, some frames at a time, with the number of the first of them."""
        for block in track_blocks(track):
            self._file.check()
            yield block


@contextmanager
def hdf_output(path: Path) -> Iterator[HdfOutput]:
    """A new HDF5 file, complete when the block ends.

    Raises
    ------
    FormatError
        If h5py is not installed.
    OSError
        If the system refuses to write, as it does when the disk is full.
    """
    h5py = HDF.load()
    with path.open("w+b", buffering=0) as raw:
        file = PatientFile(raw)
        with h5py.File(file, "w") as root:
            yield HdfOutput(root, file)
        file.check()
