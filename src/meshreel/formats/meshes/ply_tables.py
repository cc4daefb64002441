"""The elements of a PLY file as tables of columns.

The body of an ASCII file is read as if it were binary with float64 for every number, so that the
same code reads both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply_header import PlyElement, PlyHeader, PlyProperty
from meshreel.formats.text.token_lines import split_lines
from meshreel.model.geometry.polygons import Integers, ragged_indices

Offsets = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PlyBody:
    """The numbers of a file after the header."""

    data: bytes
    """In the declared types, or float64 for all numbers of an ASCII file."""
    order: str
    """{"<", ">", "="}. Byte order."""
    locate: Callable[[int], str] | None = None
    """For an ASCII file: describes the location in messages, such as "line 7"."""

    def code(self, declared: str) -> str:
        """Return the type code of numbers in the body, given the declared one."""
        return declared if self.locate is None else "f8"

    def width(self, declared: str) -> int:
        """Number of bytes of a number of the declared type."""
        return int(self.code(declared)[1:])

    def take(self, offsets: Integers, declared: str) -> npt.NDArray[Any]:
        """Return the numbers at the given byte offsets, in the declared type.

        Raises
        ------
        FormatError
            If an integer type is declared and a word of an ASCII file is none in its range.
        """
        code, stride = self.order + self.code(declared), _stride(offsets)
        if stride:  # a view is ten times faster than gathering bytes
            array = np.ndarray(len(offsets), code, self.data, int(offsets[0]), (stride,))
        else:
            byte_indices = offsets[:, None] + np.arange(self.width(declared))
            array = np.frombuffer(self.data, np.uint8)[byte_indices].view(code)[:, 0]
        if self.locate is not None and not declared.startswith("f"):
            limits = np.iinfo(declared)
            valid = (array == np.rint(array)) & (array >= limits.min) & (array < limits.max + 1.0)
            if not valid.all():
                first = int(np.argmin(valid))
                raise FormatError(
                    f"{self.locate(int(offsets[first]))}: expected {np.dtype(declared).name}; got "
                    f"{array[first]:g}"
                )
        with np.errstate(over="ignore"):
            return array.astype(declared)


def _stride(offsets: Integers) -> int:
    """Common distance of consecutive offsets; 0 if it varies or there are fewer than two."""
    if len(offsets) < 2:
        return 0
    stride = int(offsets[1]) - int(offsets[0])
    return stride if (np.diff(offsets) == stride).all() else 0


@dataclass(frozen=True, eq=False)
class PlyTable:
    """The rows of an element."""

    element: PlyElement
    body: PlyBody
    offsets: dict[str, Offsets]
    """dict of str to int64 array of shape (number of rows,). Byte offset of each property in each
    row; for a list, that of its length.
    """
    end: int
    """First byte after the element."""

    def numbers(self, column: PlyProperty) -> npt.NDArray[Any]:
        """Return the number of each row, in the declared type."""
        return self.body.take(self.offsets[column.name], column.code)

    def lists(self, column: PlyProperty) -> tuple[Integers, npt.NDArray[Any]]:
        """Return the list length of each row, and the concatenated numbers of all lists."""
        offsets = self.offsets[column.name]
        lengths = self.body.take(offsets, column.count_code).astype(np.int64)
        starts, width = offsets + self.body.width(column.count_code), self.body.width(column.code)
        if (lengths[:1] == lengths).all() and 0 < lengths.max(initial=0) < len(lengths):
            column_offsets = [starts + width * number for number in range(lengths[0])]
            columns = [self.body.take(item_offsets, column.code) for item_offsets in column_offsets]
            return lengths, np.stack(columns, axis=1).ravel()
        offsets = np.repeat(starts, lengths) + width * ragged_indices(0 * lengths, lengths)
        return lengths, self.body.take(offsets, column.code)


def read_ply_tables(header: PlyHeader, data: bytes) -> dict[str, PlyTable]:
    """Return the tables of a PLY file by element name.

    Raises
    ------
    FormatError
        If vertices or faces are not declared, or rows are missing.
    """
    names = [element.name for element in header.elements]
    if not {"vertex", "face"} <= {*names}:
        raise FormatError(
            f"has elements {', '.join(names) or '(none)'}; a mesh needs 'vertex' and 'face'"
        )
    body = _body(header, data)
    tables: dict[str, PlyTable] = {}
    start = 0
    for element in header.elements:
        table = read_table(element, body, start)
        tables.setdefault(element.name, table)
        start = table.end
    return tables


def _body(header: PlyHeader, data: bytes) -> PlyBody:
    if header.encoding != "ascii":
        order = "<" if header.encoding == "binary_little_endian" else ">"
        return PlyBody(data[header.body_start :], order)
    # Tokenize the header too, so that errors name the right line.
    lines = split_lines(data)
    first = int(np.searchsorted(lines.starts, header.body_start))
    values = lines.floats(np.arange(first, len(lines.starts)))
    return PlyBody(values.tobytes(), "=", lambda offset: lines.word_location(first + offset // 8))


def read_table(element: PlyElement, body: PlyBody, start: int) -> PlyTable:
    """Return the table of an element that begins at an offset.

    Raises
    ------
    FormatError
        If the declared rows do not fit in the file, or a list has a negative length.
    """
    row_width = sum(body.width(column.count_code or column.code) for column in element.properties)
    _check_fits(element, element.n_rows * row_width, len(body.data) - start)
    if element.n_rows == 0 or not element.properties:
        no_offsets = {column.name: np.empty(0, np.int64) for column in element.properties}
        return PlyTable(element, body, no_offsets, start)
    return _table_of_equal_rows(element, body, start) or _table_of_rows(element, body, start)


def _table_of_equal_rows(element: PlyElement, body: PlyBody, start: int) -> PlyTable | None:
    """Table if all lists are as long as in the first row, as in most files; otherwise None."""
    first, row_width = _walk_row(element, body, start)
    end = start + element.n_rows * row_width
    if end > len(body.data):
        return None
    rows = row_width * np.arange(element.n_rows)
    offsets = {name: rows + offset for name, offset in first.items()}
    for column in element.properties:
        if column.count_code:
            lengths = body.take(offsets[column.name], column.count_code)
            if (lengths != lengths[0]).any():
                return None
    return PlyTable(element, body, offsets, end)


def _table_of_rows(element: PlyElement, body: PlyBody, start: int) -> PlyTable:
    row_offsets: dict[str, list[int]] = {column.name: [] for column in element.properties}
    end = start
    for _ in range(element.n_rows):
        row, width = _walk_row(element, body, end)
        for name, offset in row.items():
            row_offsets[name].append(offset)
        end += width
    offsets = {name: np.array(starts, np.int64) for name, starts in row_offsets.items()}
    return PlyTable(element, body, offsets, end)


def _walk_row(element: PlyElement, body: PlyBody, start: int) -> tuple[dict[str, int], int]:
    """Return the offset of each property of the row at `start`, and the width of the row."""
    offsets, offset, n_left = {}, start, len(body.data) - start
    for column in element.properties:
        offsets[column.name] = offset
        length = 1
        if column.count_code:
            _check_fits(element, offset + body.width(column.count_code) - start, n_left)
            length = int(body.take(np.array([offset]), column.count_code)[0])
            offset += body.width(column.count_code)
        if length < 0:
            raise FormatError(f"element {element.name!r} has a list of {length} values")
        offset += length * body.width(column.code)
    _check_fits(element, offset - start, n_left)
    return offsets, offset - start


def _check_fits(element: PlyElement, n_bytes: int, n_left: int) -> None:
    if n_bytes > n_left:
        raise FormatError(
            f"element {element.name!r} with {element.n_rows} rows is longer than the rest of the "
            "file; it is truncated or its header is wrong"
        )
