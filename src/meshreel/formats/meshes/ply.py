"""Polygon File Format (PLY): the vertices and faces of one frame.

Supports ASCII and both binary encodings, any additional elements and properties, polygons and
triangle strips. Positions keep the declared type: double stays float64, and integers become a
float type that represents them. `meshreel.formats.meshes.ply_surface` reads the attributes.

trimesh is not used: it splits vertices at texture seams, reorders faces if quads and triangles are
mixed, cannot read binary lists of varying length, and raises numpy errors on damaged files.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply_header import PlyProperty
from meshreel.formats.meshes.ply_tables import STRIPS, BinaryCells, PlyTable, read_ply_tables
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.geometry.polygons import Integers
from meshreel.model.sequence import Vertices

INDEX_NAMES = ("vertex_indices", "vertex_index")

RESTART = -1
"""Index value that begins a new strip."""


def parse_ply(data: bytes) -> PolygonMesh:
    """Parse the mesh of a PLY file.

    Raises
    ------
    FormatError
        If the header is invalid, or rows or faces are missing.
    """
    return ply_mesh(read_ply_tables(data))


def ply_mesh(tables: dict[str, PlyTable]) -> PolygonMesh:
    """Return the mesh of the tables of a PLY file; raises as `parse_ply`."""
    counts, corners = _faces(tables["face"]) if "face" in tables else _strips(tables[STRIPS])
    return polygon_mesh(_vertices(tables["vertex"]), counts, corners)


def ply_positions_reader(first: bytes, mesh: PolygonMesh) -> Callable[[bytes], Vertices | None]:
    """Return a function that reads only the positions of files that are otherwise equal to `first`.

    It takes the bytes of a file and returns None if the file must be parsed completely, as every
    ASCII file.
    """
    table = read_ply_tables(first)["vertex"]
    cells, has_lists = table.cells, any(column.count_code for column in table.element.properties)
    if has_lists or not isinstance(cells, BinaryCells):
        return lambda data: None
    body = len(first) - cells.n_cells
    before, after = first[: body + table.layout.start], first[body + table.layout.end :]

    def positions(data: bytes) -> Vertices | None:
        if len(data) != len(first) or not (data.startswith(before) and data.endswith(after)):
            return None
        return _vertices(replace(table, cells=BinaryCells(data[body:], cells.byte_order)))

    return positions


def _vertices(table: PlyTable) -> Vertices:
    columns = [table.element.property_named(axis) for axis in "xyz"]
    if any(column.count_code for column in columns):
        raise FormatError("element 'vertex' has a list where x, y or z should be a number")
    values = [table.numbers(column) for column in columns]
    dtype = np.result_type(np.float32, *(column.dtype for column in values))
    return np.stack(values, axis=1).astype(dtype)


def _faces(table: PlyTable) -> tuple[Integers, Integers]:
    return table.lists(_indices(table))


def _strips(table: PlyTable) -> tuple[Integers, Integers]:
    triangles = split_strips(*table.lists(_indices(table)))
    return np.full(len(triangles), 3, np.int64), triangles.ravel()


def _indices(table: PlyTable) -> PlyProperty:
    column = table.element.property_named(*INDEX_NAMES)
    if not column.count_code or column.code.startswith("f"):
        raise FormatError(f"property {column.name!r} must be a list of integers")
    return column


def split_strips(lengths: Integers, values: Integers) -> Integers:
    """Split strips into consistently oriented triangles of shape (M, 3).

    Parameters
    ----------
    lengths : integer array
        Length of each list; each list begins a new strip.
    values : integer array of shape (sum of lengths,)
        Vertex indices, with `RESTART` between strips.
    """
    corners = values.astype(np.int64)
    places = np.arange(len(corners))
    is_restart = corners == RESTART
    lists = np.repeat(np.arange(len(lengths)), lengths)
    is_first = np.diff(lists, prepend=-1) > 0
    is_first[1:] |= is_restart[:-1]
    begin = np.maximum.accumulate(np.where(is_first, places, 0))
    first = places[: max(0, len(corners) - 2)]
    # Keep windows of three vertices in one strip, without a restart among them.
    first = first[(begin[first + 2] <= first) & ~is_restart[first + 2]]
    is_reversed = (first - begin[first]) % 2
    return np.stack(
        [corners[first], corners[first + 1 + is_reversed], corners[first + 2 - is_reversed]], axis=1
    )
