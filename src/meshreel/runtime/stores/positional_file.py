"""Local files whose position is not shared with forked processes."""

import io
import os
from typing import BinaryIO, cast


class PositionalFile:
    """A file to read, with its own position.

    All processes that inherit an open file share its position: a seek in one moves the others. Here
    each read passes its position to the system. There is no buffer, because a forked child could
    inherit its lock in the locked state.

    Parameters
    ----------
    file : seekable binary file
        Closed by `close`, but not when this object is deleted: it belongs to the caller.
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
        """Move to a byte; `SEEK_END` refers to the size of the file when it was opened."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size_bytes}
        self._position = max(0, origin[whence] + offset)
        return self._position

    def tell(self) -> int:
        """Return the position of the next read."""
        return self._position

    def read(self, size: int = -1) -> bytes:
        """Return `size` bytes, fewer only at the end of the file; by default all up to the end."""
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
    """Return a `PositionalFile` for a plain file, and any other file unchanged."""
    is_plain = isinstance(file, io.FileIO | io.BufferedReader) and isinstance(
        getattr(file, "raw", file), io.FileIO
    )
    if not is_plain or not hasattr(os, "pread"):
        return file
    return cast("BinaryIO", PositionalFile(file))
