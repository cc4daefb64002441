"""Attributes of a PLY file.

Supports colors, texture coordinates, every other number of vertices and faces under its own name,
and corner texture coordinates in the face list ``texcoord``. Normals are read if they change
between frames; other lists and elements are ignored.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.frames.field_tracks import Field, Fields, Key
from meshreel.formats.meshes.ply import INDEX_NAMES, ply_mesh
from meshreel.formats.meshes.ply_header import PlyProperty, read_ply_header
from meshreel.formats.meshes.ply_tables import STRIPS, PlyTable, read_ply_tables
from meshreel.formats.notes import note_kinds, note_normals
from meshreel.model.surface import VALUE_TYPES, Attribute, Domain, Kind, Surface

COLOR_NAMES = ("red", "green", "blue", "alpha")
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
CORNER_UV_NAME = "texcoord"
NORMALS = ("nx", "ny", "nz")
NORMALS_NAME = "normals"
NOT_ATTRIBUTES = ("x", "y", "z", *NORMALS)


def parse_ply_surface(data: bytes, notes: list[str] | None = None) -> Surface:
    """Return the attributes of a PLY file; the notes list omitted data.

    Raises
    ------
    FormatError
        As `parse_ply`, and if a number does not have the declared type.
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


def parse_ply_fields(data: bytes) -> Fields:
    """Return all numbers of vertices, faces and corners of a PLY file, in their own types.

    Raises
    ------
    FormatError
        As `parse_ply_surface`.
    """
    tables = read_ply_tables(data)
    vertices, found = tables["vertex"], dict[Key, tuple[Values, Field]]()
    remaining = {one.name: one for one in vertices.element.properties if not one.count_code}
    if _share_type(remaining, NORMALS, ("f4", "f8")):
        values = np.stack([vertices.numbers(remaining[name]) for name in NORMALS], axis=1)
        _add_field(found, (Domain.VERTEX, NORMALS_NAME), values, "", NORMALS_ROLE)
    for table, domain in ((vertices, Domain.VERTEX), (tables.get("face"), Domain.FACE)):
        for name, kind, values in () if table is None else _columns(table, domain):
            _add_field(found, (domain, name), values, "" if kind is Kind.OTHER else kind)
    if "face" in tables:
        uv = _corner_coordinates(tables["face"], ply_mesh(tables).counts)
        if uv is not None:
            _add_field(found, (Domain.CORNER, uv.name), uv.values, uv.kind)
    return found


def _add_field(
    found: dict[Key, tuple[Values, Field]], key: Key, values: Values, kind: str, role: str = ""
) -> None:
    """Add values under a unique name."""
    while key in found:
        key = key[0], f"{key[1]}_"
    found[key] = values, Field(values.dtype, values.shape[1], role, kind)


def _note_left_out(tables: dict[str, PlyTable], notes: list[str], *, has_corner_uv: bool) -> None:
    shape = ("vertex", "face") if "face" in tables else ("vertex", STRIPS)
    names = {column.name for column in tables["vertex"].element.properties}
    if names & set(NORMALS):
        note_normals(notes)
    known = {*INDEX_NAMES, *([CORNER_UV_NAME] if has_corner_uv else [])}
    lists = [
        f"{name}.{column.name}"
        for name in shape
        for column in tables[name].element.properties
        if column.count_code and not (name != "vertex" and column.name in known)
    ]
    note_kinds(notes, "lists", lists)
    others = [name for name, one in tables.items() if one.element.n_rows]
    note_kinds(notes, "elements", (name for name in others if name not in shape))


def _attributes(table: PlyTable, domain: Domain) -> Iterator[Attribute]:
    """Yield the columns of a table as attributes, in types that attributes allow."""
    for name, kind, values in _columns(table, domain):
        wide_enough = (one for one in VALUE_TYPES if np.can_cast(values.dtype, one))
        yield Attribute(name, kind, domain, values.astype(next(wide_enough)))


def _columns(table: PlyTable, domain: Domain) -> Iterator[tuple[str, Kind, Values]]:
    """Yield color, texture coordinates, and all other numbers of the rows of a table."""
    remaining = {
        column.name: column
        for column in table.element.properties
        if not column.count_code and not (domain is Domain.VERTEX and column.name in NOT_ATTRIBUTES)
    }
    for names in (COLOR_NAMES, COLOR_NAMES[:3]):
        if _share_type(remaining, names, ("u1", "f4", "f8")):
            yield "color", Kind.COLOR, _pop_columns(table, remaining, names)
            break
    for pair in UV_NAMES if domain is Domain.VERTEX else ():
        if _share_type(remaining, pair, ("f4", "f8")):
            yield "uv", Kind.UV, _pop_columns(table, remaining, pair)
            break
    for name in tuple(remaining):
        yield name, Kind.OTHER, _pop_columns(table, remaining, [name])


def _share_type(
    columns: dict[str, PlyProperty], names: Sequence[str], codes: Sequence[str]
) -> bool:
    """Whether all named columns exist and share one of the given types."""
    types = {columns[name].code if name in columns else "" for name in names}
    return len(types) == 1 and types <= {*codes}


def _pop_columns(table: PlyTable, columns: dict[str, PlyProperty], names: Sequence[str]) -> Values:
    """Remove the named columns, and return their numbers of shape (N, C)."""
    return np.stack([table.numbers(columns.pop(name)) for name in names], axis=1)


def _corner_coordinates(table: PlyTable, counts: npt.NDArray[np.int64]) -> Attribute | None:
    """Corner texture coordinates, if every face has two numbers for each corner."""
    for column in table.element.properties:
        if column.name == CORNER_UV_NAME and column.count_code and column.code in ("f4", "f8"):
            lengths, values = table.lists(column)
            if (lengths == 2 * counts).all():
                return Attribute("uv", Kind.UV, Domain.CORNER, values.reshape(-1, 2))
    return None
