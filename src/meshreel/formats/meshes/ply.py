"""Polygon File Format (PLY): the vertices and faces of one frame.

Our own reader: the one of trimesh splits vertices at texture seams, reorders faces when quads and
triangles are mixed, cannot read binary files with lists of mixed length, and raises what numpy
raises on damaged files. Read: ASCII and both binary encodings, any further elements and
properties, faces of any size, triangle strips. Positions keep the declared type: double stays
float64, integers become a float type that holds them. `meshreel.formats.meshes.ply_surface` reads
what else is of use.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply_cells import BinaryCells
from meshreel.formats.meshes.ply_header import PlyProperty
from meshreel.formats.meshes.ply_tables import STRIPS, PlyTable, read_ply_tables
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.geometry.ragged import Integers
from meshreel.model.sequence import Vertices

INDEX_NAMES = ("vertex_indices", "vertex_index")

RESTART = -1
"""In place of a vertex: the next one begins a new strip."""


def parse_ply(data: bytes) -> PolygonMesh:
    """The mesh of the bytes of a PLY file.

    Raises
    ------
    FormatError
        If the header is wrong, the declared rows are not all there, or there are no faces.
    """
    return ply_mesh(read_ply_tables(data))


def ply_mesh(tables: dict[str, PlyTable]) -> PolygonMesh:
    """The mesh of the tables of a PLY file; as `parse_ply`."""
    counts, corners = _faces(tables["face"]) if "face" in tables else _strips(tables[STRIPS])
    return polygon_mesh(_vertices(tables["vertex"]), counts, corners)


def ply_positions_like(first: bytes, mesh: PolygonMesh) -> Callable[[bytes], Vertices | None]:
    """A function from the bytes of another file to its positions, if the rest is the same bytes.

    It gives None for a file that must be read whole. Text is always read whole.
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
    triangles = cut_strips(*table.lists(_indices(table)))
    return np.full(len(triangles), 3, np.int64), triangles.ravel()


def _indices(table: PlyTable) -> PlyProperty:
    column = table.element.property_named(*INDEX_NAMES)
    if not column.count_code or column.code.startswith("f"):
        raise FormatError(f"property {column.name!r} must be a list of integers")
    return column


def cut_strips(lengths: Integers, values: Integers) -> Integers:
    """The triangles of strips, of shape (M, 3), all facing the same side of their strip.

    Parameters
    ----------
    lengths : integer array
        How many values each list has; a list begins a new strip.
    values : integer array of shape (sum of lengths,)
        Vertices, and `RESTART` between strips.
    """
    corners = values.astype(np.int64)
    places = np.arange(len(corners))
    is_restart = corners == RESTART
    lists = np.repeat(np.arange(len(lengths)), lengths)
    is_first = np.diff(lists, prepend=-1) > 0
    is_first[1:] |= is_restart[:-1]
    begin = np.maximum.accumulate(np.where(is_first, places, 0))
    first = places[: max(0, len(corners) - 2)]
    # The third vertex is of the same strip, which has no restart in it then.
    first = first[(begin[first + 2] <= first) & ~is_restart[first + 2]]
    is_turned = (first - begin[first]) % 2
    return np.stack(
        [corners[first], corners[first + 1 + is_turned], corners[first + 2 - is_turned]], axis=1
    )
