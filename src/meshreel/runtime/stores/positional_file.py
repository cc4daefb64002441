"""A local file whose position is not shared with forked processes."""

import io
import os
from typing import BinaryIO, cast


class PositionalFile:
    """A file to read, with a position that no other object shares.

    The position of an open file is shared by all processes that inherit it: where one seeks, the
    next read of another begins. Here each read names its position, so that no process moves that
    of others. There is no buffer, whose lock a forked child could inherit locked.

    Parameters
    ----------
    file : binary file that can seek
        Closed with `close`, and not when this object is deleted: it belongs to the caller.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size_bytes = file.seek(0, os.SEEK_END)
        self._position = 0

    @property
    def name(self) -> str | int:
        """Name of the file, or its descriptor."""
        return self._file.name

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a byte; the end is that of the file when it was opened."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size_bytes}
        self._position = max(0, origin[whence] + offset)
        return self._position

    def tell(self) -> int:
        """Return the position of the next read."""
        return self._position

    def read(self, size: int = -1) -> bytes:
        """Return this many bytes, fewer only at the end of the file; by default all that follow."""
        end = self._size_bytes if size < 0 else self._position + size
        parts = []
        while self._position < end:
            part = os.pread(self._file.fileno(), end - self._position, self._position)
            if not part:
                break
            parts.append(part)
            self._position += len(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def with_own_position(file: BinaryIO) -> BinaryIO:
    """Return a `PositionalFile` of a plain file opened to be read; any other file unchanged."""
    is_plain = isinstance(file, io.FileIO | io.BufferedReader) and isinstance(
        getattr(file, "raw", file), io.FileIO
    )
    if not is_plain or not hasattr(os, "pread"):
        return file
    return cast("BinaryIO", PositionalFile(file))
