"""Numbers and texts that follow one another in a piece of data."""

import struct

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.ogawa import damaged


class Records:
    """What lies in a piece of data, read from its beginning.

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
