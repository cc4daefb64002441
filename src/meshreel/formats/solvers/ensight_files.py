"""Geometry and variable files of EnSight Gold: parts of elements, and values for them.

Files consist of lines of text and tables of numbers, as text or C binary.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, Singles
from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming, read_bytes
from meshreel.formats.surfaces.cells import POLYGON, Cells
from meshreel.kernel.cells import cell_sizes
from meshreel.model.notes import Notes

LINE_BYTES = 80
FIRST_PART = 5 * LINE_BYTES
EXTENTS_BYTES = LINE_BYTES + 6 * 4
FIRST_TABLES = FIRST_PART + EXTENTS_BYTES + LINE_BYTES + 4
"""Bytes of a binary file up to the number of its first part."""

MAX_PART = 1 << 16
"""Part numbers above this mean that bytes are swapped."""


class Tables:
    """A file, read in order.

    Parameters
    ----------
    order : str, optional
        Byte order: "<" or ">"; None for a text file.
    read_lines : function of a path
        Reads the lines of a text file.

    Attributes
    ----------
    position : int
        The next byte, or line of a text file.
    """

    def __init__(
        self, path: Path, order: str | None, read_lines: Callable[[Path], list[str]]
    ) -> None:
        self.path: Path = path
        self.order: str | None = order
        self.position: int = 0
        self.lines: list[str] | None = read_lines(path) if order is None else None
        with os_errors_naming(path):
            self._size = path.stat().st_size if self.lines is None else len(self.lines)

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
        if self.lines is not None:
            return self.lines[self._advance(1)].strip()
        data = self._read(np.dtype(np.uint8), LINE_BYTES).tobytes()
        return data.partition(b"\0")[0].decode("latin-1").strip()

    def integers(self, count: int, n_rows: int | None = None) -> Integers:
        """Read integers; text has them in a number of rows, by default one in each."""
        if self.lines is not None:
            return self._parse(count, n_rows, np.dtype(np.int64))
        return self._read(np.dtype(f"{self.order}i4"), count).astype(np.int64)

    def floats(self, count: int) -> Singles:
        """Read floats."""
        if self.lines is not None:
            return self._parse(count, None, np.dtype(np.float32))
        return self._read(np.dtype(f"{self.order}f4"), count).astype(np.float32, copy=False)

    def skip(self, count: int, n_rows: int | None = None) -> None:
        """Skip numbers; parameters as of `integers`."""
        self._advance(4 * count if self.lines is None else count if n_rows is None else n_rows)

    def _advance(self, n_units: int) -> int:
        start = self.position
        if n_units < 0 or start + n_units > self._size:
            location = f"byte {start}" if self.lines is None else f"line {start + 1}"
            raise FormatError(f"{self.path.name} is truncated, or damaged at {location}")
        self.position += n_units
        return start

    def _read(self, dtype: np.dtype[Any], count: int) -> npt.NDArray[Any]:
        start = self._advance(count * dtype.itemsize)
        with os_errors_naming(self.path):
            numbers = np.fromfile(self.path, dtype, count, offset=start)
        if len(numbers) != count:
            raise FormatError(f"{self.path.name} became shorter while it was read; start again")
        return numbers

    def _parse(self, count: int, n_rows: int | None, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        assert self.lines is not None
        start = self._advance(count if n_rows is None else n_rows)
        words = " ".join(self.lines[start : self.position]).split()
        location = f"from line {start + 1} on"
        try:
            numbers = np.array(words, dtype)
        except (ValueError, OverflowError) as error:
            raise FormatError(f"{self.path.name} has bad numbers {location} ({error})") from error
        if len(numbers) != count:
            raise FormatError(
                f"{self.path.name} has {len(numbers)} numbers {location}; expected {count}"
            )
        return numbers


def read_lines(path: Path) -> list[str]:
    """Read the lines of a text file."""
    return read_bytes(path).decode("latin-1").splitlines()


def find_order(path: Path) -> str | None:
    """Return the byte order of a geometry file, and of files of variables with it; None if text.

    Raises
    ------
    FormatError
        If it is Fortran binary.
    """
    with os_errors_naming(path), path.open("rb") as file:
        head = file.read(FIRST_TABLES)
    if b"fortran binary" in head[: 2 * LINE_BYTES].lower():
        raise FormatError(f"{path.name} is Fortran binary; write it as C binary or text")
    if not head[:LINE_BYTES].lower().startswith(b"c binary"):
        return None
    offset = FIRST_PART + (EXTENTS_BYTES if head[FIRST_PART:].startswith(b"extents") else 0)
    number = head[offset + LINE_BYTES : offset + LINE_BYTES + 4]
    return "<" if int.from_bytes(number, "little") <= MAX_PART else ">"


TYPES = {
    "point": 1, "bar2": 3, "bar3": 21, "tria3": 5, "tria6": 22, "quad4": 9, "quad8": 23,
    "tetra4": 10, "tetra10": 24, "pyramid5": 14, "pyramid13": 27, "penta6": 13, "penta15": 26,
    "hexa8": 12, "hexa20": 25,
}  # fmt: skip
"""VTK type of each type of element."""

NSIDED, NFACED, GHOST = "nsided", "nfaced", "g_"
EXPLICIT = ("given", "ignore")
"""Numbering modes for which a file contains the numbers."""


@dataclass(frozen=True)
class Block:
    """The elements of a type in a part."""

    kind: str
    """As in the file, such as "hexa8" or "g_hexa8"."""
    count: int
    position: int
    """Position of the nodes in the file."""

    @property
    def has_faces(self) -> bool:
        """Whether its elements have faces that are read: no points, bars or ghosts."""
        return not self.kind.startswith((GHOST, "point", "bar"))


@dataclass(frozen=True)
class Part:
    """A part of a geometry."""

    number: int
    name: str
    n_nodes: int
    position: int
    """Position of the coordinates in the file."""
    blocks: tuple[Block, ...]


Columns = dict[tuple[int, str], tuple[int, float | None]]
"""Position of the values of a variable in its file, and the value that marks missing data, if any.

Keys are the part and the type of elements, which is "" for nodes.
"""


def find_parts(tables: Tables, notes: Notes) -> dict[int, Part]:
    """Return the parts of a geometry file by number; notes name user numbers, which are not read.

    Raises
    ------
    FormatError
        If the file is truncated or damaged, or contains an unknown type of element.
    """
    for _ in range(2 if tables.lines is not None else 3):  # binary files begin with "C Binary"
        tables.line()
    has_numbers = []
    for label in ("node id", "element id"):
        line = tables.line().lower()
        if not line.startswith(label):
            raise FormatError(f"{tables.path.name} has {line[:40]!r} where {label!r} is expected")
        has_numbers.append(line.split()[-1] in EXPLICIT)
    if any(has_numbers):
        notes.left_out("user numbers of nodes and elements")
    parts: dict[int, Part] = {}
    line = _next_line(tables)
    if line.startswith("extents"):
        tables.skip(6, 3)
        line = _next_line(tables)
    while line.startswith("part"):
        number, name = int(tables.integers(1)[0]), tables.line()
        kind = tables.line()
        if not kind.startswith("coordinates"):
            raise FormatError(
                f"{tables.path.name} contains the structured part {name!r} ({kind[:40]!r}); parts "
                "of elements are supported: write it as unstructured"
            )
        n_nodes = int(tables.integers(1)[0])
        tables.skip(n_nodes * has_numbers[0])
        position = tables.position
        tables.skip(3 * n_nodes)
        blocks: list[Block] = []
        line = _next_line(tables)
        while line and not line.startswith("part"):
            block = _find_block(tables, line.split()[0], has_numbers=has_numbers[1])
            if any(other.kind == block.kind for other in blocks):
                raise FormatError(f"{tables.path.name} has two tables of {block.kind} in {name!r}")
            blocks.append(block)
            line = _next_line(tables)
        if number in parts:
            raise FormatError(f"{tables.path.name} contains part {number} twice")
        parts[number] = Part(number, name, n_nodes, position, tuple(blocks))
    if line:
        raise FormatError(f"{tables.path.name} has {line[:40]!r} where 'part' is expected")
    return parts


def _next_line(tables: Tables) -> str:
    return "" if tables.is_at_end else tables.line()


def _find_block(tables: Tables, kind: str, *, has_numbers: bool) -> Block:
    base = kind.removeprefix(GHOST)
    if base not in TYPES and base not in (NSIDED, NFACED):
        raise FormatError(
            f"{tables.path.name} contains elements of the unknown type {kind[:40]!r}; known are "
            f"{', '.join([*TYPES, NSIDED, NFACED])}"
        )
    count = int(tables.integers(1)[0])
    tables.skip(count * has_numbers)
    block = Block(kind, count, tables.position)
    if base in TYPES:
        tables.skip(count * int(cell_sizes()[TYPES[base]]), count)
    elif base == NSIDED:
        tables.skip(_total(tables.integers(count)), count)
    else:
        n_faces = _total(tables.integers(count))
        tables.skip(_total(tables.integers(n_faces)), n_faces)
    return block


def _total(counts: Integers) -> int:
    if (counts < 0).any():
        raise FormatError("has an element with a negative number of nodes; it is damaged")
    return int(counts.sum())


def read_columns(tables: Tables, position: int, n_rows: int, n_columns: int) -> Singles:
    """Read values that are stored component by component, of shape (N, C)."""
    tables.position = position
    return tables.floats(n_rows * n_columns).reshape(n_columns, n_rows).T


def read_cells(tables: Tables, part: Part) -> Cells:
    """Read the elements of a part that have faces, in the order of the file."""
    blocks = (_read_block(tables, block) for block in part.blocks if block.has_faces)
    return Cells.join(blocks)


def _read_block(tables: Tables, block: Block) -> Cells:
    tables.position, count = block.position, block.count
    if block.kind == NSIDED:
        counts = tables.integers(count)
        return Cells(np.full(count, POLYGON), counts, tables.integers(_total(counts), count) - 1)
    if block.kind == NFACED:
        n_faces = tables.integers(count)
        sizes = tables.integers(_total(n_faces))
        nodes = tables.integers(_total(sizes), len(sizes)) - 1
        return Cells.polyhedra(n_faces, sizes, nodes)
    n_nodes = int(cell_sizes()[TYPES[block.kind]])
    nodes = tables.integers(count * n_nodes, count) - 1
    return Cells(np.full(count, TYPES[block.kind]), np.full(count, n_nodes), nodes)


def find_columns(tables: Tables, parts: dict[int, Part], width: int) -> Columns:
    """Return the positions of the values in the file of a variable.

    Raises
    ------
    FormatError
        If the file is truncated or damaged, does not fit the parts, or has partial values.
    """
    columns: Columns = {}
    tables.position = 0
    tables.line()
    part: Part | None = None
    name = tables.path.name
    while not tables.is_at_end:
        line = tables.line()
        kind, *modifiers = line.split() or [""]
        if kind == "part":
            number = int(tables.integers(1)[0])
            part = parts.get(number)
            if part is None:
                raise FormatError(f"{name} has values of part {number}, which the geometry lacks")
            continue
        is_nodes = kind == "coordinates"
        counts = [block.count for block in part.blocks if block.kind == kind] if part else []
        if part is None or not (is_nodes or counts):
            raise FormatError(f"{name} has {line[:40]!r} where values of its parts are expected")
        if modifiers == ["partial"]:
            raise FormatError(f"{name} has partial values, which are not supported")
        undefined = float(tables.floats(1)[0]) if modifiers == ["undef"] else None
        columns[part.number, "" if is_nodes else kind] = tables.position, undefined
        tables.skip(width * (part.n_nodes if is_nodes else sum(counts)))
    return columns


def read_values(
    tables: Tables,
    part: Part,
    columns: Columns,
    width: int,
    *,
    at_nodes: bool,
) -> Singles:
    """Read the values of a variable at the nodes or the elements of a part; NaN where it has none.

    Returns
    -------
    float32 array of shape (N, width)
        Elements are those of `read_cells`.
    """
    sizes = {"": part.n_nodes}
    if not at_nodes:
        sizes = {block.kind: block.count for block in part.blocks if block.has_faces}
    tables_of_kinds = [np.empty((0, width), np.float32)]
    for kind, n_rows in sizes.items():
        position, undefined = columns.get((part.number, kind), (None, None))
        values: Singles = np.full((n_rows, width), np.nan, np.float32)
        if position is not None:
            values = read_columns(tables, position, n_rows, width)
        if undefined is not None:
            values = np.where(values == np.float32(undefined), np.float32(np.nan), values)
        tables_of_kinds.append(values)
    return np.concatenate(tables_of_kinds)
