"""The body of a PLY file as *cells*: bytes of a binary file, words of an ASCII file.

This lets `meshreel.formats.meshes.ply_tables` read both encodings with the same code.
"""

from collections.abc import Callable
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.model.geometry.ragged import Integers


class PlyCells(Protocol):
    """The body of a PLY file as an array of cells."""

    n_cells: int

    def width(self, code: str) -> int:
        """Number of cells of a number of the given type."""

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """Return the numbers at the given cell offsets, in the declared type."""

    def integer_at(self, offset: int, code: str) -> int:
        """Return the integer at a cell offset."""


class BinaryCells:
    """Cells that are bytes.

    Parameters
    ----------
    body : bytes
        The file after the header.
    byte_order : {"<", ">"}
        Little or big endian.
    """

    def __init__(self, body: bytes, byte_order: str) -> None:
        self.n_cells = len(body)
        self._body = body
        self._codes = np.frombuffer(body, dtype=np.uint8)
        self.byte_order = byte_order

    def width(self, code: str) -> int:
        """Number of bytes of a number of the given type."""
        return int(code[1:])

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """Return the numbers at the given byte offsets, in native byte order."""
        width, stride = self.width(code), _stride(offsets)
        if stride:  # a view is ten times faster than gathering bytes
            first, dtype = int(offsets[0]), self.byte_order + code
            return np.ndarray(len(offsets), dtype, self._body, first, (stride,)).astype(code)
        words = self._codes[offsets[:, None] + np.arange(width)]
        numbers: npt.NDArray[Any] = words.view(self.byte_order + code)[:, 0].astype(code)
        return numbers

    def integer_at(self, offset: int, code: str) -> int:
        """Return the integer at a byte offset."""
        word = self._body[offset : offset + self.width(code)]
        order: Literal["little", "big"] = "little" if self.byte_order == "<" else "big"
        return int.from_bytes(word, order, signed=code.startswith("i"))


def _stride(offsets: Integers) -> int:
    """Common distance of consecutive offsets; 0 if it varies or there are fewer than two."""
    if len(offsets) < 2:
        return 0
    stride = int(offsets[1]) - int(offsets[0])
    return stride if (np.diff(offsets) == stride).all() else 0


class WordCells:
    """Cells that are words of an ASCII file, one for each number.

    Parameters
    ----------
    values : float64 array of shape (number of words,)
        The words after the header, parsed as numbers.
    place : function of a cell
        Describes the location of a word for error messages, such as "line 7".
    """

    def __init__(self, values: npt.NDArray[np.float64], place: Callable[[int], str]) -> None:
        self.n_cells = len(values)
        self._values = values
        self._place = place

    def width(self, code: str) -> int:
        """Return 1: every number is one word."""
        return 1

    def take(self, offsets: Integers, code: str) -> npt.NDArray[Any]:
        """Return the numbers at the given word offsets, in the declared type.

        Raises
        ------
        FormatError
            If an integer type is declared and a word is not an integer in its range.
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
        """Return the integer at a word offset; raises as `take`."""
        return int(self.take(np.array([offset]), code)[0])
