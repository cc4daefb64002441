"""Tokenizer for legacy VTK files: lines, words and number arrays in file order."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

NUMBERS = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4",
    "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8",
    "vtkidtype": "i4", "vtktypeint64": "i8", "vtktypeuint64": "u8",
}  # fmt: skip
BYTES_PER_NUMBER = 16  # first guess for a number in ASCII


class LegacyTokens:
    """Reads lines and numbers of a legacy VTK file sequentially.

    Parameters
    ----------
    data : bytes

    Attributes
    ----------
    position : int
        Byte offset of the next token; may be set back to read a line again.
    is_text : bool
        Whether numbers are ASCII; otherwise they are big-endian binary.
    """

    def __init__(self, data: bytes) -> None:
        self._data, self.position = data, 0
        self.is_text = True

    def raw_line(self) -> str:
        """Return the next line, which may be empty; an empty string after the last line."""
        end = self._data.find(b"\n", self.position)
        end = len(self._data) if end < 0 else end
        line = self._data[self.position : end].decode("latin-1").strip()
        self.position = min(len(self._data), end + 1)
        return line

    @property
    def is_done(self) -> bool:
        """Whether the end of the file is reached."""
        return self.position >= len(self._data)

    def line(self) -> list[str]:
        """Return the words of the next line that is not blank; empty at the end of the file."""
        while not self.is_done:
            if words := self.raw_line().split():
                return words
        return []

    def numbers(self, count: int, kind: str) -> npt.NDArray[Any]:
        """Read `count` numbers of a VTK type name, in native byte order.

        Raises
        ------
        FormatError
            If the file ends before them, or the type is unknown.
        """
        code = NUMBERS.get(kind.lower())
        if code is None:
            raise FormatError(f"has values of type {kind!r}; allowed are {', '.join(NUMBERS)}")
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
        words = self._read_words(count)
        try:
            if code[0] == "f":
                return np.array([float(word) for word in words], code)
            return np.array([int(word) for word in words], np.int64).astype(code)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"expected numbers before byte {self.position}: {error}") from error

    def _read_words(self, count: int) -> list[bytes]:
        """Return the next `count` words, splitting no more of the file than necessary."""
        length = count * BYTES_PER_NUMBER
        while True:
            piece = self._data[self.position : self.position + length]
            *words, rest = [*piece.split(None, count), b""][: count + 1]
            reaches_end = self.position + length >= len(self._data)
            if len(words) == count and (rest or reaches_end):
                self.position += len(piece) - len(rest)
                return words
            if reaches_end:
                raise FormatError(f"ends within {count} numbers that begin at byte {self.position}")
            length = 2 * length + BYTES_PER_NUMBER
