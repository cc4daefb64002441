"""The words and numbers of a legacy file of VTK, one after the other."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

NUMBERS = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4",
    "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8",
    "vtkidtype": "i4", "vtktypeint64": "i8", "vtktypeuint64": "u8",
}  # fmt: skip
WORD_BYTES = 16  # of a number in text, about


class LegacyWords:
    """A legacy file, read from its beginning to its end.

    Parameters
    ----------
    data : bytes

    Attributes
    ----------
    position : int
        The byte at which what comes next begins; may be set back.
    is_text : bool
        Whether numbers are words; else they are binary, big endian.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self.position = data, 0
        self.is_text = True

    def raw_line(self) -> str:
        """The next line, which may be empty; behind the end an empty one."""
        end = self._data.find(b"\n", self.position)
        end = len(self._data) if end < 0 else end
        line = self._data[self.position : end].decode("latin-1").strip()
        self.position = min(len(self._data), end + 1)
        return line

    @property
    def is_done(self) -> bool:
        """Whether all was read."""
        return self.position >= len(self._data)

    def line(self) -> list[str]:
        """The words of the next line that has some; none behind the end."""
        while not self.is_done:
            if words := self.raw_line().split():
                return words
        return []

    def numbers(self, count: int, kind: str) -> npt.NDArray[Any]:
        """So many numbers of a type, in native byte order.

        Raises
        ------
        FormatError
            If they are not there, or the type is not known.
        """
        code = NUMBERS.get(kind.lower())
        if code is None:
            raise FormatError(f"holds values of type {kind!r}; known are {', '.join(NUMBERS)}")
        if not 0 <= count <= len(self._data):
            raise FormatError(f"declares {count} numbers in a file of {len(self._data)} bytes")
        return self._text(count, code) if self.is_text else self._binary(count, code)

    def _binary(self, count: int, code: str) -> npt.NDArray[Any]:
        size = count * int(code[1])
        block = self._data[self.position : self.position + size]
        if len(block) < size:
            raise FormatError(f"ends within {count} numbers that begin at byte {self.position}")
        self.position += size
        return np.frombuffer(block, f">{code}").astype(code)

    def _text(self, count: int, code: str) -> npt.NDArray[Any]:
        words = self._take_words(count)
        try:
            if code[0] == "f":
                return np.array([float(word) for word in words], code)
            return np.array([int(word) for word in words], np.int64).astype(code)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"expected numbers before byte {self.position}: {error}") from error

    def _take_words(self, count: int) -> list[bytes]:
        length = count * WORD_BYTES
        while True:
            piece = self._data[self.position : self.position + length]
            *words, rest = [*piece.split(None, count), b""][: count + 1]
            is_all = self.position + length >= len(self._data)
            if len(words) == count and (rest or is_all):
                self.position += len(piece) - len(rest)
                return words
            if is_all:
                raise FormatError(f"ends within {count} numbers that begin at byte {self.position}")
            length = 2 * length + WORD_BYTES
