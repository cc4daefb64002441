"""Parts of an EnSight Gold geometry, and the values of variables for them."""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Integers, Singles
from meshreel.errors import FormatError
from meshreel.formats.solvers.ensight_tables import Tables
from meshreel.formats.surfaces.cells import POLYGON, POLYHEDRON, Cells
from meshreel.model.geometry.polygons import ragged_indices

N_NODES = {
    "point": 1, "bar2": 2, "bar3": 3, "tria3": 3, "tria6": 6, "quad4": 4, "quad8": 8, "tetra4": 4,
    "tetra10": 10, "pyramid5": 5, "pyramid13": 13, "penta6": 6, "penta15": 15, "hexa8": 8,
    "hexa20": 20,
}  # fmt: skip
"""Nodes of each type of element."""

CORNERS = {
    "tria": (5, (0, 1, 2)), "quad": (9, (0, 1, 2, 3)), "tetra": (10, (0, 1, 2, 3)),
    "pyramid": (14, (0, 1, 2, 3, 4)), "penta": (13, (0, 2, 1, 3, 5, 4)),
    "hexa": (12, (0, 1, 2, 3, 4, 5, 6, 7)),
}  # fmt: skip
"""VTK type of elements with faces, and their corners in the order of VTK."""

NSIDED, NFACED, GHOST = "nsided", "nfaced", "g_"
GIVEN = ("given", "ignore")
"""Ways of numbering for which a file contains the numbers."""


@dataclass(frozen=True)
class Block:
    """The elements of a type in a part.

    Parameters
    ----------
    kind : str
        As in the file, such as "hexa8" or "g_hexa8".
    count : int
    position : int
        Of the nodes in the file.
    """

    kind: str
    count: int
    position: int

    @property
    def has_faces(self) -> bool:
        """Whether its elements have faces that are read: no points, bars or ghosts."""
        return self.kind in (NSIDED, NFACED) or self.kind.rstrip("0123456789") in CORNERS


@dataclass(frozen=True)
class Part:
    """A part of a geometry.

    Parameters
    ----------
    number, n_nodes : int
    name : str
    position : int
        Of the coordinates in the file.
    blocks : tuple of Block
    """

    number: int
    name: str
    n_nodes: int
    position: int
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Column:
    """Place of the values of a variable at the nodes or the elements of one type in a part.

    Parameters
    ----------
    position : int
        Of the values in the file.
    undefined : float or None
        The value that means none.
    """

    position: int
    undefined: float | None


Columns = dict[tuple[int, str], Column]
"""Places of the values of a variable by part and type of elements, which is "" for nodes."""


def find_parts(tables: Tables) -> dict[int, Part]:
    """Return the parts of a geometry file by number.

    Raises
    ------
    FormatError
        If the file is truncated or damaged, or contains an unknown type of element.
    """
    tables.line()
    tables.line()
    has_numbers = []
    for what in ("node id", "element id"):
        line = tables.line().lower()
        if not line.startswith(what):
            raise FormatError(f"{tables.path.name} has {line[:40]!r} where {what!r} is expected")
        has_numbers.append(line.split()[-1] in GIVEN)
    parts: dict[int, Part] = {}
    line = "" if tables.is_at_end else tables.line()
    if line.startswith("extents"):
        tables.skip(6, 3)
        line = "" if tables.is_at_end else tables.line()
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
        line = "" if tables.is_at_end else tables.line()
        while line and not line.startswith("part"):
            block = _find_block(tables, line.split()[0], has_numbers=has_numbers[1])
            if any(one.kind == block.kind for one in blocks):
                raise FormatError(f"{tables.path.name} has two tables of {block.kind} in {name!r}")
            blocks.append(block)
            line = "" if tables.is_at_end else tables.line()
        if number in parts:
            raise FormatError(f"{tables.path.name} contains part {number} twice")
        parts[number] = Part(number, name, n_nodes, position, tuple(blocks))
    if line:
        raise FormatError(f"{tables.path.name} has {line[:40]!r} where 'part' is expected")
    return parts


def _find_block(tables: Tables, kind: str, *, has_numbers: bool) -> Block:
    base = kind.removeprefix(GHOST)
    if base not in N_NODES and base not in (NSIDED, NFACED):
        raise FormatError(
            f"{tables.path.name} contains elements of the unknown type {kind[:40]!r}; known are "
            f"{', '.join([*N_NODES, NSIDED, NFACED])}"
        )
    count = int(tables.integers(1)[0])
    tables.skip(count * has_numbers)
    block = Block(kind, count, tables.position)
    if base in N_NODES:
        tables.skip(count * N_NODES[base], count)
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


def read_points(tables: Tables, part: Part) -> Singles:
    """Read the coordinates of a part, of shape (N, 3)."""
    return read_columns(tables, part.position, part.n_nodes, 3)


def read_columns(tables: Tables, position: int, n_rows: int, n_columns: int) -> Singles:
    """Read values that are stored one component after the other, of shape (N, C)."""
    tables.position = position
    return tables.floats(n_rows * n_columns).reshape(n_columns, n_rows).T


def read_cells(tables: Tables, part: Part) -> Cells:
    """Read the elements of a part that have faces, in the order of the file."""
    found = [_read_block(tables, block) for block in part.blocks if block.has_faces]
    return Cells(
        np.concatenate([np.empty(0, np.int64), *(one.types for one in found)]),
        np.concatenate([np.empty(0, np.int64), *(one.counts for one in found)]),
        np.concatenate([np.empty(0, np.int64), *(one.points for one in found)]),
    )


def _read_block(tables: Tables, block: Block) -> Cells:
    tables.position, count = block.position, block.count
    if block.kind == NSIDED:
        counts = tables.integers(count)
        return Cells(np.full(count, POLYGON), counts, tables.integers(_total(counts), count) - 1)
    if block.kind == NFACED:
        return _read_polyhedra(tables, count)
    n_nodes = N_NODES[block.kind]
    kind, corners = CORNERS[block.kind.rstrip("0123456789")]
    nodes = tables.integers(count * n_nodes, count).reshape(count, n_nodes)[:, corners] - 1
    return Cells(np.full(count, kind), np.full(count, len(corners)), nodes.ravel())


def _read_polyhedra(tables: Tables, count: int) -> Cells:
    """Read polyhedra; each becomes its number of faces and, for each face, its size and nodes."""
    n_faces = tables.integers(count)
    sizes = tables.integers(_total(n_faces))
    nodes = tables.integers(_total(sizes), len(sizes)) - 1
    of_face = np.empty(len(nodes) + len(sizes), np.int64)
    starts = np.cumsum(sizes + 1) - sizes - 1
    of_face[starts] = sizes
    of_face[ragged_indices(starts + 1, sizes)] = nodes
    first = np.cumsum(n_faces) - n_faces  # the first face of each cell
    begins = np.append(starts, len(of_face))
    lengths = begins[first + n_faces] - begins[first] + 1
    points = np.insert(of_face, begins[first], n_faces)
    return Cells(np.full(count, POLYHEDRON), lengths, points)


def find_columns(tables: Tables, parts: dict[int, Part], width: int) -> Columns:
    """Return the places of the values in the file of a variable.

    Raises
    ------
    FormatError
        If the file is truncated or damaged, does not fit the parts, or has partial values.
    """
    found: Columns = {}
    tables.position = 0
    tables.line()
    part: Part | None = None
    name = tables.path.name
    while not tables.is_at_end:
        line = tables.line()
        kind, *more = line.split() or [""]
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
        if more == ["partial"]:
            raise FormatError(f"{name} has partial values, which are not supported")
        undefined = float(tables.floats(1)[0]) if more == ["undef"] else None
        found[part.number, "" if is_nodes else kind] = Column(tables.position, undefined)
        tables.skip(width * (part.n_nodes if is_nodes else sum(counts)))
    return found


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
    if at_nodes:
        sizes = {"": part.n_nodes}
    else:
        sizes = {}
        for block in part.blocks:
            if block.has_faces:
                sizes[block.kind] = sizes.get(block.kind, 0) + block.count
    found = []
    for kind, n_rows in sizes.items():
        column = columns.get((part.number, kind))
        if column is None:
            found.append(np.full((n_rows, width), np.nan, np.float32))
            continue
        values = read_columns(tables, column.position, n_rows, width)
        if column.undefined is not None:
            values = np.where(values == np.float32(column.undefined), np.float32(np.nan), values)
        found.append(values)
    return np.concatenate([np.empty((0, width), np.float32), *found])
