"""The Ogawa container of an Alembic file: groups of references, and blocks of data.

It is parsed here because the Alembic library aborts the process on some damaged files.
"""

import struct
import zlib
from io import SEEK_END
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.frames.stored_frames import changed_error

MAGIC, FINISHED = b"Ogawa", 0xFF
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
HEADER = struct.Struct("<5sB2sQ")  # magic, finished flag, version, root group offset
LENGTH = struct.Struct("<Q")
IS_DATA = 1 << 63
"""Flag of a reference to data; otherwise it refers to a group. The other bits are the offset."""

References = npt.NDArray[np.uint64]


class OgawaFile:
    """The groups and data of an Ogawa file, read on demand with bounds checks.

    Attributes
    ----------
    root : int
        Reference to the root group.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If it is not an Ogawa file, or was not completely written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._checksums: dict[int, int] = {}
        try:
            with path.open("rb") as stream:
                head = stream.read(HEADER.size)
        except OSError as error:
            raise InvalidInputError(f"cannot be read: {error.strerror}") from error
        if head.startswith(HDF5_MAGIC):
            raise FormatError(
                "is an Alembic file of the older HDF5 kind; convert it with "
                "`abcconvert -toOgawa` or export it again"
            )
        if len(head) < HEADER.size or not head.startswith(MAGIC):
            raise FormatError("is not an Alembic file; expected it to begin with 'Ogawa'")
        _, finished, version, self.root = HEADER.unpack(head)
        if finished != FINISHED:
            raise FormatError("is an Alembic file that was not completely written; export it again")
        if version != b"\x00\x01":
            raise FormatError(f"has Ogawa version {version.hex()}; only version 0001 is supported")

    def group(self, reference: int) -> References:
        """Return the references in a group; an empty array if the group is empty.

        Raises
        ------
        FormatError
            If the reference is not to a group, or the group ends after the end of the file.
        """
        if reference & IS_DATA:
            raise damage_error("found data where a group was expected")
        return np.frombuffer(self._length_prefixed(reference, 8), np.uint64)

    def data(self, reference: int) -> bytes:
        """Return a block of data, which must not have changed since it was first read.

        Raises
        ------
        FormatError
            If the reference is not to data, or the data end after the end of the file.
        InvalidInputError
            If the data have changed.
        """
        if not reference & IS_DATA:
            raise damage_error("found a group where data were expected")
        offset = reference ^ IS_DATA
        try:
            contents = self._length_prefixed(offset, 1)
        except FormatError:
            if offset in self._checksums:
                raise changed_error(str(self.path)) from None
            raise
        if self._checksums.setdefault(offset, checksum := zlib.crc32(contents)) != checksum:
            raise changed_error(str(self.path))
        return contents

    def _length_prefixed(self, offset: int, item_bytes: int) -> bytes:
        """Return the bytes after a length, which counts items of `item_bytes` each."""
        if offset == 0:
            return b""
        # Opened for each read, so that others may rename or replace the file.
        with os_errors_naming(self.path), self.path.open("rb") as stream:
            # Check against the file size first: offset and length may be damaged.
            remaining = stream.seek(0, SEEK_END) - offset - LENGTH.size
            if remaining >= 0:
                stream.seek(offset)
                size = LENGTH.unpack(stream.read(LENGTH.size))[0] * item_bytes
                if size <= remaining and len(contents := stream.read(size)) == size:
                    return contents
        raise damage_error(f"the block at byte {offset} ends after the end of the file")


def damage_error(what: str) -> FormatError:
    """Return the error for a file that contradicts itself."""
    return FormatError(f"is damaged: {what}; export it again")


class Records:
    """Sequential reader of the numbers and strings in a block of data.

    Every method raises `FormatError` if the data end too early.
    """

    def __init__(self, contents: bytes) -> None:
        self._contents = contents
        self._offset = 0

    @property
    def is_at_end(self) -> bool:
        """Whether everything has been read."""
        return self._offset >= len(self._contents)

    def number(self, size_bytes: int) -> int:
        """Return the next unsigned integer."""
        return int.from_bytes(self._read(size_bytes), "little")

    def seconds(self) -> float:
        """Return the next float64."""
        (value,) = struct.unpack("<d", self._read(8))
        return float(value)

    def times(self, count: int) -> npt.NDArray[np.float64]:
        """Return the next `count` float64 values."""
        return np.frombuffer(self._read(8 * count), "<f8").astype(np.float64)

    def text(self, size_bytes: int) -> str:
        """Return the next string; bytes that are not UTF-8 are replaced."""
        return self._read(size_bytes).decode(errors="replace")

    def metadata(self, size_bytes: int) -> dict[str, str]:
        """Return the next metadata, stored as "key=value;key=value"."""
        pairs = (pair.partition("=") for pair in self.text(size_bytes).split(";"))
        return {key: value for key, _, value in pairs}

    def _read(self, size_bytes: int) -> bytes:
        start, self._offset = self._offset, self._offset + size_bytes
        if self._offset > len(self._contents):
            raise damage_error("a list ends in the middle of an entry")
        return self._contents[start : self._offset]
