"""The container of an Alembic file: groups of references and pieces of data, called Ogawa.

Read here and not by the library, which ends the process when a damaged file misleads it.
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
HEADER = struct.Struct("<5sB2sQ")  # magic, whether finished, version, place of the root group
LENGTH = struct.Struct("<Q")
IS_DATA = 1 << 63
"""Set in a reference to data; without it a reference is to a group. The rest is a place."""

References = npt.NDArray[np.uint64]


class OgawaFile:
    """The groups and data of a file, each read when it is asked for, from within its bounds.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    path : Path
    root : int
        Reference to the first group.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If it is no Ogawa file, or was not finished.
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
                "is an Alembic file of the older kind, HDF5; convert it with "
                "`abcconvert -toOgawa` or export it again"
            )
        if len(head) < HEADER.size or not head.startswith(MAGIC):
            raise FormatError("is not an Alembic file; expected it to begin with 'Ogawa'")
        _, finished, version, self.root = HEADER.unpack(head)
        if finished != FINISHED:
            raise FormatError("is an Alembic file whose writing was not finished; export it again")
        if version != b"\x00\x01":
            raise FormatError(f"is of Ogawa version {version.hex()}; 0001 is read")

    def group(self, reference: int) -> References:
        """The references that a group holds; none if it is empty.

        Raises
        ------
        FormatError
            If there is no group, or it ends behind the end of the file.
        """
        if reference & IS_DATA:
            raise damaged("a group was expected where data are")
        return np.frombuffer(self._counted(reference, 8), np.uint64)

    def data(self, reference: int) -> bytes:
        """The bytes of a piece of data, as they were when they were first read.

        Raises
        ------
        FormatError
            If there are no data, or they end behind the end of the file.
        InvalidInputError
            If they have changed.
        """
        if not reference & IS_DATA:
            raise damaged("data were expected where a group is")
        place = reference ^ IS_DATA
        try:
            contents = self._counted(place, 1)
        except FormatError:
            if place in self._checksums:
                raise changed_error(str(self.path)) from None
            raise
        if self._checksums.setdefault(place, found := zlib.crc32(contents)) != found:
            raise changed_error(str(self.path))
        return contents

    def _counted(self, place: int, width: int) -> bytes:
        """The bytes behind their number, which counts so many at a time."""
        if place == 0:
            return b""
        # Opened each time, so that others may rename the file or write a new one in its place.
        with os_errors_naming(self.path), self.path.open("rb") as stream:
            # What is there is known first: a damaged place or length is not to be sought or read.
            left = stream.seek(0, SEEK_END) - place - LENGTH.size
            if left >= 0:
                stream.seek(place)
                wanted = LENGTH.unpack(stream.read(LENGTH.size))[0] * width
                if wanted <= left and len(contents := stream.read(wanted)) == wanted:
                    return contents
        raise damaged(f"what begins at byte {place} ends behind the end of the file")


def damaged(what: str) -> FormatError:
    """The error to raise where a file contradicts itself."""
    return FormatError(f"is damaged: {what}; export it again")


class Records:
    """The numbers and texts of a piece of data, read from its beginning.

    Parameters
    ----------
    contents : bytes

    Every method raises `FormatError` if the data end before what is asked for does.
    """

    def __init__(self, contents: bytes) -> None:
        self._contents = contents
        self._place = 0

    @property
    def is_at_end(self) -> bool:
        """Whether everything was read."""
        return self._place >= len(self._contents)

    def number(self, size_bytes: int) -> int:
        """An unsigned whole number."""
        return int.from_bytes(self._take(size_bytes), "little")

    def seconds(self) -> float:
        """A float64."""
        (found,) = struct.unpack("<d", self._take(8))
        return float(found)

    def times(self, count: int) -> npt.NDArray[np.float64]:
        """Several float64."""
        return np.frombuffer(self._take(8 * count), "<f8").astype(np.float64)

    def text(self, size_bytes: int) -> str:
        """A text; bytes that are not UTF-8 are replaced."""
        return self._take(size_bytes).decode(errors="replace")

    def metadata(self, size_bytes: int) -> dict[str, str]:
        """A text of pairs, "key=value;key=value"."""
        pairs = (pair.partition("=") for pair in self.text(size_bytes).split(";"))
        return {key: value for key, _, value in pairs}

    def _take(self, size_bytes: int) -> bytes:
        start, self._place = self._place, self._place + size_bytes
        if self._place > len(self._contents):
            raise damaged("a list ends in the middle of an entry")
        return self._contents[start : self._place]
