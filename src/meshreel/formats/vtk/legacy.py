"""Reader for legacy VTK files (``.vtk``): polygons or cells at one time, ASCII or binary.

Reads POLYDATA and UNSTRUCTURED_GRID of versions 1 to 5.1. VTK's own reader is not used, for the
reason given in `meshreel.formats.vtk.xml_file`.
"""

from dataclasses import replace
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, TEXTURE_COORDINATES
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.steps import DataArray, Piece, Step, loaded_array
from meshreel.formats.kinds import FrameFormat
from meshreel.formats.surfaces.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    POLYHEDRON,
    STRIP,
    VTK_POLYHEDRON,
    Cells,
)
from meshreel.formats.vtk.xml_arrays import COMPONENTS, DERIVED, TIMES
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain

NUMBERS = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4",
    "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8",
    "vtkidtype": "i4", "vtktypeint64": "i8", "vtktypeuint64": "u8",
}  # fmt: skip

SIGNATURE = "# vtk DataFile Version"
COLORS = "COLOR_SCALARS"
DATA = {"POINT_DATA": Domain.VERTEX, "CELL_DATA": Domain.FACE}
DATASETS = ("POLYDATA", "UNSTRUCTURED_GRID")
GROUPS = {
    "VERTICES": POLY_VERTEX, "LINES": POLY_LINE, "POLYGONS": POLYGON, "TRIANGLE_STRIPS": STRIP,
    "CELLS": 0,
}  # fmt: skip
WIDTHS = {
    "VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1,
}  # fmt: skip
"""Number of components of the sections that do not declare it."""


class LegacyTokens:
    """Reads lines and numbers of a legacy VTK file sequentially.

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
        *words, remaining = [*self._data[self.position :].split(None, count), b""][: count + 1]
        if len(words) < count:
            raise FormatError(f"ends within {count} numbers that begin at byte {self.position}")
        self.position = len(self._data) - len(remaining)
        try:
            return np.array(words, code if code[0] == "f" else np.int64).astype(code)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"expected numbers before byte {self.position}: {error}") from error


def read_vtk_legacy(data: bytes) -> Step:
    """Parse a legacy ``.vtk`` file.

    Raises
    ------
    FormatError
        If the data is not a legacy VTK file, has an unsupported dataset type, or is damaged.
    """
    tokens = LegacyTokens(data)
    if not tokens.raw_line().startswith(SIGNATURE):
        raise FormatError(
            f"does not begin with {SIGNATURE!r}; expected a legacy VTK file; the extension of VTK "
            "XML files is .vtp, .vtu or .pvd"
        )
    tokens.raw_line()  # a title
    encoding = tokens.raw_line().upper()
    if encoding not in ("ASCII", "BINARY"):
        raise FormatError(
            f"has {encoding[:40]!r} in line 3; expected ASCII or BINARY there, after the title"
        )
    tokens.is_text = encoding == "ASCII"
    return _LegacyReader(tokens).read()


def read_vtk(data: bytes) -> Frame:
    """Read a frame; raises as `read_vtk_legacy`, or if two arrays share a name."""
    return read_vtk_legacy(data).frame()


class _LegacyReader:
    """Parser state: the sections of a file that have been read so far."""

    def __init__(self, tokens: LegacyTokens) -> None:
        self._tokens = tokens
        self._points: Vertices = np.empty((0, 3), np.float32)
        self._cells: dict[str, tuple[Integers, Integers]] = {}
        self._types: npt.NDArray[np.integer] | None = None
        self._arrays: dict[Domain, list[DataArray]] = {domain: [] for domain in DATA.values()}
        self._domain: Domain | None = None
        self._n_values = 0
        self._left_out: list[tuple[str, str]] = []
        self._time_s: float | None = None
        self._last = "points", 3  # name and width of the array that metadata belongs to

    def read(self) -> Step:
        """Parse the whole file."""
        while line := self._tokens.line():
            keyword, args = line[0].upper(), line[1:]
            try:
                self._section(keyword, args)
            except (ValueError, IndexError) as error:
                raise FormatError(
                    f"has an invalid line {' '.join(line)[:60]!r} ({error})"
                ) from error
        groups = ((kind, self._cells.get(name)) for name, kind in GROUPS.items())
        cells = Cells.join(
            Cells(np.full(len(lists[0]), kind), *lists) for kind, lists in groups if lists
        )
        if self._types is not None:
            if len(self._types) != len(cells.types):
                raise FormatError(f"has {len(self._types)} CELL_TYPES for {len(cells.types)} cells")
            # Points of polyhedra are already stored with their numbers of faces and corners.
            types = np.where(self._types == VTK_POLYHEDRON, POLYHEDRON, self._types)
            cells = replace(cells, types=types)
        arrays = tuple(array for arrays in self._arrays.values() for array in arrays)
        return Piece(self._points, cells, arrays).step(self._left_out, self._time_s)

    def _section(self, keyword: str, args: list[str]) -> None:
        match keyword:
            case "DATASET":
                if args[0].upper() not in DATASETS:
                    raise FormatError(f"is a {args[0]}; {' and '.join(DATASETS)} are supported")
            case "POINTS":
                points = self._tokens.numbers(3 * int(args[0]), args[1]).reshape(-1, 3)
                is_float = points.dtype.kind == "f"
                self._points = points if is_float else points.astype(np.float64)
            case "CELL_TYPES":
                self._types = self._tokens.numbers(int(args[0]), "int")
            case "POINT_DATA" | "CELL_DATA":
                self._domain, self._n_values = DATA[keyword], int(args[0])
            case "METADATA":
                self._metadata()
            case "FIELD":
                for _ in range(int(args[1])):
                    self._field_array()
            case _ if keyword in GROUPS:
                self._cells[keyword] = self._connectivity(int(args[0]), int(args[1]))
            case _:
                self._values(keyword, args)

    def _connectivity(self, n_cells: int, size: int) -> tuple[Integers, Integers]:
        """Point count of each cell and all point indices: lists, or offsets since version 5."""
        begin = self._tokens.position
        line = self._tokens.line() if n_cells else []
        if line and line[0].upper() == "OFFSETS":
            ends = self._tokens.numbers(n_cells, line[1]).astype(np.int64)
            line = self._tokens.line()
            points = self._tokens.numbers(size, line[1]).astype(np.int64)
            return np.diff(ends), points
        self._tokens.position = begin
        return _split_lists(self._tokens.numbers(size, "int").astype(np.int64), n_cells)

    def _values(self, keyword: str, args: list[str]) -> None:
        if keyword == "LOOKUP_TABLE":
            self._left_out.append(("color tables", args[0]))
            self._tokens.numbers(
                4 * int(args[1]), "float" if self._tokens.is_text else "unsigned_char"
            )
            return
        if keyword == "SCALARS":
            width = int(args[2]) if len(args) > 2 else 1
            begin = self._tokens.position
            if self._tokens.line()[:1] != ["LOOKUP_TABLE"]:
                self._tokens.position = begin
            self._add(args[0], args[1], width)
        elif keyword == COLORS:
            self._add(
                args[0], "float" if self._tokens.is_text else "unsigned_char", int(args[1]), COLORS
            )
        elif keyword == "TEXTURE_COORDINATES":
            self._add(args[0], args[2], int(args[1]), TEXTURE_COORDINATES)
        elif keyword in WIDTHS:
            self._add(args[0], args[1], WIDTHS[keyword], NORMALS if keyword == "NORMALS" else "")
        else:
            raise FormatError(f"has an unknown section {keyword[:40]!r}")

    def _add(self, name: str, kind: str, width: int, role: str = "") -> None:
        self._last = unquote(name), width
        values = self._tokens.numbers(self._n_values * width, kind).reshape(-1, width)
        if role == COLORS and self._tokens.is_text:  # ASCII files store colors as 0..1 floats
            values = (255 * np.clip(np.nan_to_num(values), 0, 1) + 0.5).astype(np.uint8)
        if self._domain is None:
            raise FormatError(f"has values {name[:40]!r} before {' or '.join(DATA)}")
        array = loaded_array(self._domain, unquote(name), values, role)
        self._arrays[self._domain].append(array)

    def _metadata(self) -> None:
        """Read the metadata of an array until a blank line; it is left out."""
        while not self._tokens.is_done and (line := self._tokens.raw_line()):
            words = line.split()
            if words[0] == "NAME" and words[1] not in DERIVED:
                self._left_out.append(("metadata", words[1]))
            elif words[0] == "COMPONENT_NAMES":
                name, width = self._last
                components: list[str] = []
                while len(components) < width and not self._tokens.is_done:
                    components.append(unquote(self._tokens.raw_line()))
                self._left_out.append((COMPONENTS, f"{name} ({', '.join(components)})"))

    def _field_array(self) -> None:
        line = self._tokens.line()
        if line and line[0].upper() == "METADATA":
            self._section("METADATA", [])
            line = self._tokens.line()
        name, width, count, kind = line
        self._last = unquote(name), int(width)
        values = self._tokens.numbers(int(width) * int(count), kind)
        if self._domain is not None and int(count) == self._n_values:
            values = values.reshape(self._n_values, int(width))
            self._arrays[self._domain].append(loaded_array(self._domain, unquote(name), values))
        elif name in TIMES and len(values) == 1:
            self._time_s = float(values[0])
        else:
            self._left_out.append(("field data", unquote(name)))


def _split_lists(numbers: Integers, n_cells: int) -> tuple[Integers, Integers]:
    """Point counts and point indices of cell lists, each of which begins with its length."""
    counts, offset, values = [], 0, numbers.tolist()
    for _ in range(n_cells):
        if offset >= len(values) or values[offset] < 0:
            raise FormatError(f"lists of {n_cells} cells do not fit their {len(values)} numbers")
        counts.append(values[offset])
        offset += 1 + values[offset]
    if offset != len(values):
        raise FormatError(f"lists of {n_cells} cells do not fit their {len(values)} numbers")
    sizes = np.array(counts, np.int64)
    is_point = np.ones(len(numbers), bool)
    is_point[np.cumsum(sizes + 1) - sizes - 1] = False
    return sizes, numbers[is_point]


FORMATS = (FrameFormat(".vtk", "VTK legacy", read_vtk, None),)
