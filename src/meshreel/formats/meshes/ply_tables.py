"""The header and the elements of a PLY file, as tables of columns.

The body of an ASCII file is read as if it were binary with float64 for every number, so that the
same code reads both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.text.token_lines import split_lines
from meshreel.model.geometry.polygons import Integers, ragged_indices
from meshreel.model.notes import Notes

ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")
HEADER_END = b"end_header"
KEYWORDS = ("format", "element", "property", "end_header")

TYPE_CODES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
    **{f"int{8 * width}": f"i{width}" for width in (1, 2, 4, 8)},
    **{f"uint{8 * width}": f"u{width}" for width in (1, 2, 4, 8)},
}  # fmt: skip
"""Numpy type codes for the names of the PLY specification and those of later exporters."""


@dataclass(frozen=True)
class PlyProperty:
    """A column of an element: one number per row, or a list preceded by its length."""

    name: str
    """Name in the file."""
    code: str
    """Numpy type code of the numbers, without byte order."""
    count_code: str = ""
    """Numpy type code of the length of a list; empty for a single number per row."""


@dataclass(frozen=True)
class PlyElement:
    """A table of the file: name, number of rows, and columns."""

    name: str
    n_rows: int
    properties: tuple[PlyProperty, ...] = ()

    def property_named(self, *names: str) -> PlyProperty:
        """Return the first property with one of the given names.

        Raises
        ------
        FormatError
            If there is none.
        """
        for candidate in self.properties:
            if candidate.name in names:
                return candidate
        raise FormatError(
            f"element {self.name!r} needs a property {' or '.join(names)}; it has "
            f"{', '.join(p.name for p in self.properties) or 'none'}"
        )


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
        code, strides = self.order + self.code(declared), np.diff(offsets)
        if strides.any() and (strides == strides[0]).all():
            # A view is ten times faster than gathering bytes.
            array = np.ndarray(len(offsets), code, self.data, int(offsets[0]), (int(strides[0]),))
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


@dataclass(frozen=True, eq=False)
class PlyTable:
    """The rows of an element."""

    element: PlyElement
    body: PlyBody
    offsets: dict[str, npt.NDArray[np.int64]]
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


def read_ply_tables(data: bytes, notes: Notes) -> dict[str, PlyTable]:
    """Return the tables of a PLY file by element name; notes name lines that are not read.

    Raises
    ------
    FormatError
        If the data is not a PLY file, a header line is invalid, which the error names, vertices or
        faces are not declared, or rows are missing.
    """
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r"):
        raise FormatError("does not begin with a line 'ply'; it is not a PLY file")
    # All lines end like the first one, with LF, CRLF or CR; the last line may mix LF and CRLF.
    is_mac = data[3:4] == b"\r" and data[4:5] != b"\n"
    line_ends = [b"\r"] if is_mac else [b"\r\n", b"\n"]
    end = data.find(line_ends[-1] + HEADER_END)
    body_start = end + len(line_ends[-1] + HEADER_END)
    line_end = next((ending for ending in line_ends if data.startswith(ending, body_start)), None)
    if end < 0 or line_end is None:
        raise FormatError("the header has no line 'end_header'; the file is truncated or damaged")
    body_start += len(line_end)

    encoding, elements, skipped, textures = "", list[PlyElement](), list[str](), list[str]()
    text = data[:end].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), start=1):
        match line.split():
            case ["format", str(name), _] if name in ENCODINGS:
                encoding = name
            case ["element", str(name), str(count)] if count.isdecimal() and len(count) < 19:
                elements.append(PlyElement(name, int(count)))
            case ["property", *words] if elements:
                elements[-1] = _with_property(elements[-1], words, number)
            case ["comment", "TextureFile" | "texture", *words] if words:
                textures.append(" ".join(words))
            case [] | ["ply" | "comment", *_]:  # comments are for people
                pass
            case words if words[0] not in KEYWORDS and (
                words[0] == "obj_info" or TYPE_CODES.keys().isdisjoint(words)
            ):
                skipped.append(f"line {number} {line.strip()[:60]!r}")
            case _:  # misspelled properties too: ignoring them would shift the data
                raise FormatError(f"line {number}: {line[:60]!r} is not a line of a PLY header")
    if not encoding:
        raise FormatError(f"the header has no format line; expected one of {', '.join(ENCODINGS)}")
    notes.left_out("lines of the header", skipped)
    notes.left_out("texture images", textures)
    names = [element.name for element in elements]
    if not {"vertex", "face"} <= {*names}:
        raise FormatError(
            f"has elements {', '.join(names) or '(none)'}; a mesh needs 'vertex' and 'face'"
        )

    if encoding == "ascii":
        # Tokenize the header too, so that errors name the right line.
        lines = split_lines(data)
        first = int(np.searchsorted(lines.starts, body_start))
        numbers = lines.floats(np.arange(first, len(lines.starts))).tobytes()
        body = PlyBody(numbers, "=", lambda offset: lines.word_location(first + offset // 8))
    else:
        body = PlyBody(data[body_start:], "<" if encoding == "binary_little_endian" else ">")
    tables: dict[str, PlyTable] = {}
    start = 0
    for element in elements:
        table = _read_table(element, body, start)
        tables.setdefault(element.name, table)
        start = table.end
    return tables


def _with_property(element: PlyElement, words: list[str], number: int) -> PlyElement:
    match words:
        case ["list", count_type, value_type, name]:
            new_property = PlyProperty(name, _code(value_type, number), _code(count_type, number))
        case [value_type, name]:
            new_property = PlyProperty(name, _code(value_type, number))
        case _:
            raise FormatError(f"line {number}: a property needs a type and a name; got {words}")
    if new_property.count_code.startswith("f"):
        raise FormatError(f"line {number}: the length of a list must be an integer; got {words}")
    if any(new_property.name == before.name for before in element.properties):
        raise FormatError(f"line {number}: property {new_property.name!r} is declared twice")
    return PlyElement(element.name, element.n_rows, (*element.properties, new_property))


def _code(type_name: str, number: int) -> str:
    if type_name not in TYPE_CODES:
        raise FormatError(
            f"line {number}: {type_name[:40]!r} is not a PLY type; "
            f"expected one of {', '.join(TYPE_CODES)}"
        )
    return TYPE_CODES[type_name]


def _read_table(element: PlyElement, body: PlyBody, start: int) -> PlyTable:
    """Return the table of an element that begins at an offset."""
    row_width = sum(body.width(column.count_code or column.code) for column in element.properties)
    _check_fits(element, element.n_rows * row_width, len(body.data) - start)
    if element.n_rows == 0 or not element.properties:
        no_offsets = {column.name: np.empty(0, np.int64) for column in element.properties}
        return PlyTable(element, body, no_offsets, start)

    # In most files, all lists are as long as in the first row.
    first, row_width = _walk_row(element, body, start)
    end = start + element.n_rows * row_width
    if end <= len(body.data):
        rows = row_width * np.arange(element.n_rows)
        offsets = {name: rows + offset for name, offset in first.items()}
        lengths = (
            body.take(offsets[column.name], column.count_code)
            for column in element.properties
            if column.count_code
        )
        if all((of_rows == of_rows[0]).all() for of_rows in lengths):
            return PlyTable(element, body, offsets, end)

    row_offsets: dict[str, list[int]] = {column.name: [] for column in element.properties}
    end = start
    for _ in range(element.n_rows):
        row, row_width = _walk_row(element, body, end)
        for name, offset in row.items():
            row_offsets[name].append(offset)
        end += row_width
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
