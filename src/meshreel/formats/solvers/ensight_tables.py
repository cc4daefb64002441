"""Files of EnSight Gold as lines of text and tables of numbers, in text or C binary."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Singles
from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming

LINE_BYTES = 80
FIRST_PART = 5 * LINE_BYTES
EXTENTS_BYTES = LINE_BYTES + 6 * 4
FIRST_TABLES = FIRST_PART + EXTENTS_BYTES + LINE_BYTES + 4
"""Bytes of a binary file up to the number of its first part."""

MAX_PART = 1 << 16
"""Part numbers above this mean that bytes are swapped."""


class BinaryTables:
    """A C binary file, read in order.

    Parameters
    ----------
    path : Path
    order : str
        Byte order: "<" or ">".

    Attributes
    ----------
    position : int
        The next byte.
    """

    def __init__(self, path: Path, order: str) -> None:
        self.path, self.order, self.position = path, order, 0
        with os_errors_naming(path):
            self._size = path.stat().st_size

    @property
    def is_at_end(self) -> bool:
        """Whether nothing follows."""
        return self.position >= self._size

    def line(self) -> str:
        """Read a line of text.

        Raises
        ------
        FormatError
            If the file ends before; also from the other methods.
        """
        data = self._read(np.dtype(np.uint8), LINE_BYTES).tobytes()
        return data.partition(b"\0")[0].decode("latin-1").strip()

    def integers(self, count: int, n_rows: int | None = None) -> Integers:
        """Read integers; text has them in a number of rows, by default one in each."""
        return self._read(np.dtype(f"{self.order}i4"), count).astype(np.int64)

    def floats(self, count: int) -> Singles:
        """Read floats."""
        return self._read(np.dtype(f"{self.order}f4"), count).astype(np.float32, copy=False)

    def skip(self, count: int, n_rows: int | None = None) -> None:
        """Skip numbers; parameters as of `integers`."""
        self._advance(4 * count)

    def _advance(self, n_bytes: int) -> int:
        start = self.position
        if n_bytes < 0 or start + n_bytes > self._size:
            raise FormatError(f"{self.path.name} is truncated, or damaged at byte {start}")
        self.position += n_bytes
        return start

    def _read(self, dtype: np.dtype[Any], count: int) -> npt.NDArray[Any]:
        start = self._advance(count * dtype.itemsize)
        with os_errors_naming(self.path):
            found = np.fromfile(self.path, dtype, count, offset=start)
        if len(found) != count:
            raise FormatError(f"{self.path.name} became shorter while it was read; start again")
        return found


class TextTables:
    """A text file, read in order; its attributes and methods are those of `BinaryTables`."""

    def __init__(self, path: Path, lines: "ReadLines") -> None:
        self.path, self.position = path, 0
        self._lines = lines(path)

    @property
    def is_at_end(self) -> bool:
        """Whether nothing follows."""
        return self.position >= len(self._lines)

    def line(self) -> str:
        """Read a line of text."""
        return self._lines[self._advance(1)].strip()

    def integers(self, count: int, n_rows: int | None = None) -> Integers:
        """Read integers in a number of rows, by default one in each."""
        return self._numbers(count, n_rows, np.dtype(np.int64))

    def floats(self, count: int) -> Singles:
        """Read floats, one in each row."""
        return self._numbers(count, None, np.dtype(np.float32))

    def skip(self, count: int, n_rows: int | None = None) -> None:
        """Skip numbers."""
        self._advance(count if n_rows is None else n_rows)

    def _advance(self, n_lines: int) -> int:
        start = self.position
        if n_lines < 0 or start + n_lines > len(self._lines):
            raise FormatError(f"{self.path.name} is truncated, or damaged at line {start + 1}")
        self.position += n_lines
        return start

    def _numbers(self, count: int, n_rows: int | None, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        start = self._advance(count if n_rows is None else n_rows)
        words = " ".join(self._lines[start : self.position]).split()
        try:
            numbers = np.array(words, dtype)
        except (ValueError, OverflowError) as error:
            raise FormatError(
                f"{self.path.name} has bad numbers from line {start + 1} on ({error})"
            ) from error
        if len(numbers) != count:
            raise FormatError(
                f"{self.path.name} has {len(numbers)} numbers from line {start + 1} on; expected "
                f"{count}"
            )
        return numbers


Tables = BinaryTables | TextTables
ReadLines = Callable[[Path], list[str]]


def read_lines(path: Path) -> list[str]:
    """Read the lines of a text file."""
    with os_errors_naming(path):
        return path.read_text("latin-1").splitlines()


def open_geometry(path: Path, lines: ReadLines = read_lines) -> Tables:
    """Open a geometry file, after the line with its encoding.

    Parameters
    ----------
    path : Path
    lines : function of a path
        Reads the lines of a text file.

    Raises
    ------
    FormatError
        If it is Fortran binary.
    """
    with os_errors_naming(path), path.open("rb") as file:
        start = file.read(FIRST_TABLES)
    if b"fortran binary" in start[: 2 * LINE_BYTES].lower():
        raise FormatError(f"{path.name} is Fortran binary; write it as C binary or text")
    if not start[:LINE_BYTES].lower().startswith(b"c binary"):
        return TextTables(path, lines)
    at = FIRST_PART + (EXTENTS_BYTES if start[FIRST_PART:].startswith(b"extents") else 0)
    number = start[at + LINE_BYTES : at + LINE_BYTES + 4]
    order = "<" if int.from_bytes(number, "little") <= MAX_PART else ">"
    tables = BinaryTables(path, order)
    tables.line()
    return tables


def open_variable(path: Path, like: Tables, lines: ReadLines = read_lines) -> Tables:
    """Open the file of a variable, which is encoded as the geometry."""
    if isinstance(like, TextTables):
        return TextTables(path, lines)
    return BinaryTables(path, like.order)
