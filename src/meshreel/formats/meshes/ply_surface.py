"""What a PLY file holds beside positions and faces.

Colours, texture coordinates, and every other number of a vertex or a face under its own name;
texture coordinates of corners as the list ``texcoord`` of a face. Normals are passed over, and so
are other lists and other elements.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.meshes.ply import ply_mesh
from meshreel.formats.meshes.ply_header import PlyProperty
from meshreel.formats.meshes.ply_tables import PlyTable, read_ply_tables
from meshreel.surface import VALUE_TYPES, Attribute, Domain, Kind, Surface

COLOR_NAMES = ("red", "green", "blue", "alpha")
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
CORNER_UV_NAME = "texcoord"
PASSED_OVER = ("x", "y", "z", "nx", "ny", "nz")

Values = npt.NDArray[Any]


def parse_ply_surface(data: bytes) -> Surface:
    """Attributes of the bytes of a PLY file.

    Raises
    ------
    FormatError
        As `parse_ply`, and if a number is not of the type that is declared.
    """
    tables = read_ply_tables(data)
    counts = ply_mesh(tables).counts
    of_vertices = tuple(_attributes(tables["vertex"], Domain.VERTEX))
    if "face" not in tables:
        return Surface(None, of_vertices)
    of_faces = tuple(_attributes(tables["face"], Domain.FACE))
    corner_uv = _corner_coordinates(tables["face"], counts)
    of_corners = () if corner_uv is None else (corner_uv,)
    return Surface(None, (*of_vertices, *of_faces, *of_corners))


def _attributes(table: PlyTable, domain: Domain) -> Iterator[Attribute]:
    """Colour, texture coordinates, and all other numbers of the rows of a table."""
    left = {
        column.name: column
        for column in table.element.properties
        if not column.count_code and not (domain is Domain.VERTEX and column.name in PASSED_OVER)
    }
    for names in (COLOR_NAMES, COLOR_NAMES[:3]):
        if _are_alike(left, names, ("u1", "f4", "f8")):
            yield Attribute("color", Kind.COLOR, domain, _taken(table, left, names))
            break
    for pair in UV_NAMES if domain is Domain.VERTEX else ():
        if _are_alike(left, pair, ("f4", "f8")):
            yield Attribute("uv", Kind.UV, domain, _taken(table, left, pair))
            break
    for name in tuple(left):
        yield Attribute(name, Kind.OTHER, domain, _taken(table, left, [name]))


def _are_alike(columns: dict[str, PlyProperty], names: Sequence[str], codes: Sequence[str]) -> bool:
    """Whether there are columns of those names, of the same one of those types."""
    types = {columns[name].code if name in columns else "" for name in names}
    return len(types) == 1 and types <= {*codes}


def _taken(table: PlyTable, columns: dict[str, PlyProperty], names: Sequence[str]) -> Values:
    """The numbers of those columns, which are removed, in a type that attributes can have."""
    values = np.stack([table.numbers(columns.pop(name)) for name in names], axis=1)
    wide_enough = (one for one in VALUE_TYPES if np.can_cast(values.dtype, one))
    return values.astype(next(wide_enough))


def _corner_coordinates(table: PlyTable, counts: npt.NDArray[np.int64]) -> Attribute | None:
    """The texture coordinates of corners, if every face has two numbers for each."""
    for column in table.element.properties:
        if column.name == CORNER_UV_NAME and column.count_code and column.code in ("f4", "f8"):
            lengths, values = table.lists(column)
            if (lengths == 2 * counts).all():
                return Attribute("uv", Kind.UV, Domain.CORNER, values.reshape(-1, 2))
    return None
