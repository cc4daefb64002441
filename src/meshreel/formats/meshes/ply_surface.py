"""Attributes of a PLY file.

Colours, texture coordinates, and every other number of a vertex or a face under its own name;
texture coordinates of corners as the list ``texcoord`` of a face. Normals are passed over, and so
are other lists and other elements.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.meshes.ply import INDEX_NAMES, ply_mesh
from meshreel.formats.meshes.ply_header import PlyProperty, read_ply_header
from meshreel.formats.meshes.ply_tables import STRIPS, PlyTable, read_ply_tables
from meshreel.formats.notes import note_kinds, note_normals
from meshreel.surface import VALUE_TYPES, Attribute, Domain, Kind, Surface

COLOR_NAMES = ("red", "green", "blue", "alpha")
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
CORNER_UV_NAME = "texcoord"
NORMALS = ("nx", "ny", "nz")
PASSED_OVER = ("x", "y", "z", *NORMALS)

Values = npt.NDArray[Any]


def parse_ply_surface(data: bytes, notes: list[str] | None = None) -> Surface:
    """Attributes of the bytes of a PLY file; notes gain a sentence on what is left out.

    Raises
    ------
    FormatError
        As `parse_ply`, and if a number is not of the type that is declared.
    """
    tables = read_ply_tables(data)
    counts = ply_mesh(tables).counts
    attributes = [*_attributes(tables["vertex"], Domain.VERTEX)]
    corner_uv = None
    if "face" in tables:
        attributes += _attributes(tables["face"], Domain.FACE)
        corner_uv = _corner_coordinates(tables["face"], counts)
    if notes is not None:
        note_kinds(notes, "lines of the header", read_ply_header(data).skipped)
        _note_left_out(tables, notes, has_corner_uv=corner_uv is not None)
    return Surface(None, (*attributes, *([corner_uv] if corner_uv is not None else [])))


def _note_left_out(tables: dict[str, PlyTable], notes: list[str], *, has_corner_uv: bool) -> None:
    shape = ("vertex", "face") if "face" in tables else ("vertex", STRIPS)
    names = {column.name for column in tables["vertex"].element.properties}
    if names & set(NORMALS):
        note_normals(notes)
    taken = {*INDEX_NAMES, *([CORNER_UV_NAME] if has_corner_uv else [])}
    lists = [
        f"{name}.{column.name}"
        for name in shape
        for column in tables[name].element.properties
        if column.count_code and not (name != "vertex" and column.name in taken)
    ]
    note_kinds(notes, "lists", lists)
    others = [name for name, one in tables.items() if one.element.n_rows]
    note_kinds(notes, "elements", (name for name in others if name not in shape))


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
