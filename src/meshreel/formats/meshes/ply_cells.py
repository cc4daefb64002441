"""The body of a PLY file as *cells*: bytes in a binary file, words in an ASCII one.

Seen so, both encodings are read by the same code (`meshreel.formats.meshes.ply_tables`).
"""

from collections.abc import Callable
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.model.geometry.ragged import Integers


class PlyCells(Protocol):
    """The body of a PLY file as a row of cells."""

    n_cells: int

    def width(self, code: str) -> int:
        """Cells that one number of that type takes."""

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """The numbers that begin at those cells, in the type that is declared."""

    def integer_at(self, offset: int, code: str) -> int:
        """The one integer that begins at that cell."""


class BinaryCells:
    """Cells that are bytes.

    Parameters
    ----------
    body : bytes
        What follows the header.
    byte_order : {"<", ">"}
        Little or big endian.
    """

    def __init__(self, body: bytes, byte_order: str) -> None:
        self.n_cells = len(body)
        self._body = body
        self._codes = np.frombuffer(body, dtype=np.uint8)
        self.byte_order = byte_order

    def width(self, code: str) -> int:
        """Bytes that one number of that type takes."""
        return int(code[1:])

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """The numbers that begin at those bytes, in native byte order."""
        width, stride = self.width(code), _stride(offsets)
        if stride:  # a view is ten times faster than to gather bytes
            first, dtype = int(offsets[0]), self.byte_order + code
            return np.ndarray(len(offsets), dtype, self._body, first, (stride,)).astype(code)
        words = self._codes[offsets[:, None] + np.arange(width)]
        numbers: npt.NDArray[Any] = words.view(self.byte_order + code)[:, 0].astype(code)
        return numbers

    def integer_at(self, offset: int, code: str) -> int:
        """The one integer that begins at that byte."""
        word = self._body[offset : offset + self.width(code)]
        order: Literal["little", "big"] = "little" if self.byte_order == "<" else "big"
        return int.from_bytes(word, order, signed=code.startswith("i"))


def _stride(offsets: Integers) -> int:
    """From each offset to the next, if that is always as far and there are at least two; else 0."""
    if len(offsets) < 2:
        return 0
    stride = int(offsets[1]) - int(offsets[0])
    return stride if (np.diff(offsets) == stride).all() else 0


class WordCells:
    """Cells that are words of an ASCII file; each number takes one.

    Parameters
    ----------
    values : float64 array of shape (number of words,)
        The words after the header.
    place : function of a cell
        Where that word stands in the file, in words.
    """

    def __init__(self, values: npt.NDArray[np.float64], place: Callable[[int], str]) -> None:
        self.n_cells = len(values)
        self._values = values
        self._place = place

    def width(self, code: str) -> int:
        """One word, whatever the type."""
        return 1

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """The words of those numbers, in the declared type.

        Raises
        ------
        FormatError
            If an integer is declared and the word is not one, or is out of its range.
        """
        values = self._values[offsets]
        if code.startswith("f"):
            with np.errstate(over="ignore"):
                return values.astype(code)
        limits = np.iinfo(code)
        good = (values == np.rint(values)) & (values >= limits.min) & (values < limits.max + 1.0)
        if not good.all():
            cell, name = int(offsets[np.argmin(good)]), np.dtype(code).name
            raise FormatError(f"{self._place(cell)}: expected {name}; got {self._values[cell]:g}")
        return values.astype(code)

    def integer_at(self, offset: int, code: str) -> int:
        """The one integer that that word is; errors as `take`."""
        return int(self.take(np.array([offset]), code)[0])
