"""The elements of a PLY file: positions of their numbers, and tables of columns.

The body of a file is read as *cells*: bytes of a binary file, words of an ASCII file, so that the
same code reads both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply_header import PlyElement, PlyHeader, PlyProperty, read_ply_header
from meshreel.formats.text.token_lines import split_lines
from meshreel.model.geometry.polygons import Integers, ragged_indices

STRIPS = "tristrips"
"""Name of the element with triangle strips."""

Offsets = npt.NDArray[np.int64]


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
        self.n_cells: int = len(body)
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
        self.n_cells: int = len(values)
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


@dataclass(frozen=True, eq=False)
class ElementLayout:
    """Cell offsets of the numbers of an element.

    Parameters
    ----------
    offsets : dict of str to int64 array of shape (number of rows,)
        Cell of each property in each row; for a list, the cell of its length.
    start, end : int
        First cell of the element, and first cell after it.
    """

    offsets: dict[str, Offsets]
    start: int
    end: int


@dataclass(frozen=True, eq=False)
class PlyTable:
    """The rows of an element.

    Parameters
    ----------
    cells : PlyCells
        Cells that the layout describes.
    """

    element: PlyElement
    layout: ElementLayout
    cells: PlyCells

    def numbers(self, column: PlyProperty) -> npt.NDArray[Any]:
        """Return the number of each row, in the declared type."""
        return self.cells.take(self.layout.offsets[column.name], column.code)

    def lists(self, column: PlyProperty) -> tuple[Integers, npt.NDArray[Any]]:
        """Return the list length of each row, and the concatenated numbers of all lists."""
        lengths, starts = list_values(self.layout, self.cells, column)
        width = self.cells.width(column.code)
        if (lengths[:1] == lengths).all() and 0 < lengths.max(initial=0) < len(lengths):
            places = [starts + width * number for number in range(lengths[0])]
            columns = [self.cells.take(place, column.code) for place in places]
            return lengths, np.stack(columns, axis=1).ravel()
        offsets = np.repeat(starts, lengths) + width * ragged_indices(0 * lengths, lengths)
        return lengths, self.cells.take(offsets, column.code)


def read_ply_tables(data: bytes) -> dict[str, PlyTable]:
    """Return the tables of a PLY file by element name.

    An empty face table is dropped if there are triangle strips.

    Raises
    ------
    FormatError
        If the header is invalid, vertices or faces are not declared, or rows are missing.
    """
    header = read_ply_header(data)
    names = [element.name for element in header.elements]
    if "vertex" not in names or not {"face", STRIPS} & {*names}:
        raise FormatError(
            f"has elements {', '.join(names) or '(none)'}; a mesh needs 'vertex', and 'face' or "
            f"{STRIPS!r}"
        )
    cells = _cells(header, data)
    tables: dict[str, PlyTable] = {}
    start = 0
    for element in header.elements:
        layout = locate_element(element, cells, start)
        tables.setdefault(element.name, PlyTable(element, layout, cells))
        start = layout.end
    if STRIPS in tables and "face" in tables and tables["face"].element.n_rows == 0:
        del tables["face"]
    return tables


def _cells(header: PlyHeader, data: bytes) -> PlyCells:
    if header.encoding != "ascii":
        order = "<" if header.encoding == "binary_little_endian" else ">"
        return BinaryCells(data[header.body_start :], order)
    # Tokenize the header too, so that errors name the right line.
    lines = split_lines(data)
    first = int(np.searchsorted(lines.starts, header.body_start))
    values = lines.floats(np.arange(first, len(lines.starts)))
    return WordCells(values, lambda cell: lines.place_of_word(first + cell))


def locate_element(element: PlyElement, cells: PlyCells, start: int) -> ElementLayout:
    """Return the layout of an element that begins at cell `start`.

    Raises
    ------
    FormatError
        If the declared rows do not fit in the file, or a list has a negative length.
    """
    row_width = sum(cells.width(p.count_code or p.code) for p in element.properties)
    _check_fits(element, element.n_rows * row_width, cells.n_cells - start)
    if element.n_rows == 0 or not element.properties:
        nowhere = {column.name: np.empty(0, np.int64) for column in element.properties}
        return ElementLayout(nowhere, start, start)
    return _locate_equal_rows(element, cells, start) or _locate_each_row(element, cells, start)


def list_values(
    layout: ElementLayout, cells: PlyCells, column: PlyProperty
) -> tuple[npt.NDArray[np.int64], Offsets]:
    """Return the lengths of the lists of a property, and the first cell of their values."""
    offsets = layout.offsets[column.name]
    lengths = cells.take(offsets, column.count_code).astype(np.int64)
    return lengths, offsets + cells.width(column.count_code)


def _locate_equal_rows(element: PlyElement, cells: PlyCells, start: int) -> ElementLayout | None:
    """Layout if all lists are as long as in the first row, as in most files; otherwise None."""
    first, row_width = _walk_row(element, cells, start)
    if element.n_rows * row_width > cells.n_cells - start:
        return None
    rows = row_width * np.arange(element.n_rows)
    offsets = {name: rows + cell for name, cell in first.items()}
    for column in element.properties:
        if column.count_code:
            lengths = cells.take(offsets[column.name], column.count_code)
            if (lengths != lengths[0]).any():
                return None
    return ElementLayout(offsets, start, start + element.n_rows * row_width)


def _locate_each_row(element: PlyElement, cells: PlyCells, start: int) -> ElementLayout:
    found: dict[str, list[int]] = {column.name: [] for column in element.properties}
    end = start
    for _ in range(element.n_rows):
        row, width = _walk_row(element, cells, end)
        for name, cell in row.items():
            found[name].append(cell)
        end += width
    offsets = {name: np.array(starts, np.int64) for name, starts in found.items()}
    return ElementLayout(offsets, start, end)


def _walk_row(element: PlyElement, cells: PlyCells, start: int) -> tuple[dict[str, int], int]:
    """Return the cell of each property of the row at `start`, and the width of the row."""
    offsets, at = {}, start
    for column in element.properties:
        offsets[column.name] = at
        length = 1
        if column.count_code:
            _check_fits(element, at + cells.width(column.count_code) - start, cells.n_cells - start)
            length = cells.integer_at(at, column.count_code)
            at += cells.width(column.count_code)
        if length < 0:
            raise FormatError(f"element {element.name!r} has a list of {length} values")
        at += length * cells.width(column.code)
    _check_fits(element, at - start, cells.n_cells - start)
    return offsets, at - start


def _check_fits(element: PlyElement, needed: int, left: int) -> None:
    if needed > left:
        raise FormatError(
            f"element {element.name!r} with {element.n_rows} rows is longer than the rest of the "
            "file; it is truncated or its header is wrong"
        )
