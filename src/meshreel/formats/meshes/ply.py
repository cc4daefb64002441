"""Polygon File Format (PLY): reader for the mesh and attributes of one frame.

Supports ASCII and both binary encodings, any additional elements and properties, and polygons.
Positions keep the declared type: double stays float64, and integers become a float type that
represents them. Colors, texture coordinates, and every other number of vertices and faces under its
own name are attributes, as are corner texture coordinates in the face list ``texcoord``. Normals
are read if they change between frames; other lists and elements are ignored.

trimesh is not used: it splits vertices at texture seams, reorders faces if quads and triangles are
mixed, cannot read binary lists of varying length, and raises numpy errors on damaged files.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.frames.field_tracks import NORMALS_NAME, Field, Key
from meshreel.formats.frames.frame import Frame
from meshreel.formats.kinds import VERTEX_FACE_CORNER, FrameFormat
from meshreel.formats.meshes.ply_tables import PlyProperty, PlyTable, read_ply_tables
from meshreel.formats.meshes.ply_writing import (
    COLOR_NAMES,
    CORNER_UV_NAME,
    INDEX_NAMES,
    NORMALS,
    NOT_ATTRIBUTES,
    UV_NAMES,
    ply_encoder,
)
from meshreel.formats.surfaces.polygons import polygon_mesh
from meshreel.model.notes import Notes, note_normals
from meshreel.model.sequence import Vertices
from meshreel.model.surface import VALUE_TYPES, Attribute, Domain, Kind, Surface


def read_ply(data: bytes) -> Frame:
    """Read a PLY file; its data keep their number types.

    Raises
    ------
    FormatError
        If the header is invalid, rows or faces are missing, or a number does not have the declared
        type.
    """
    notes = Notes()
    tables = read_ply_tables(data, notes)
    vertices, faces = tables["vertex"], tables["face"]
    axes = [vertices.element.property_named(axis) for axis in "xyz"]
    if any(column.count_code for column in axes):
        raise FormatError("element 'vertex' has a list where x, y or z should be a number")
    coordinates = [vertices.numbers(column) for column in axes]
    dtype = np.result_type(np.float32, *(column.dtype for column in coordinates))
    positions: Vertices = np.stack(coordinates, axis=1).astype(dtype)
    indices = faces.element.property_named(*INDEX_NAMES)
    if not indices.count_code or indices.code.startswith("f"):
        raise FormatError(f"property {indices.name!r} must be a list of integers")
    mesh = polygon_mesh(positions, *faces.lists(indices))

    attributes, fields = list[Attribute](), dict[Key, tuple[Values, Field]]()
    scalars = {
        column.name: column for column in vertices.element.properties if not column.count_code
    }
    if _share_type(scalars, NORMALS, ("f4", "f8")):
        values = np.stack([vertices.numbers(scalars[name]) for name in NORMALS], axis=1)
        _add_field(fields, (Domain.VERTEX, NORMALS_NAME), values, "", NORMALS_ROLE)
    for table, domain in ((vertices, Domain.VERTEX), (faces, Domain.FACE)):
        for name, kind, values in _columns(table, domain):
            _add_field(fields, (domain, name), values, "" if kind is Kind.OTHER else kind)
            wide_enough = (dtype for dtype in VALUE_TYPES if np.can_cast(values.dtype, dtype))
            attributes.append(Attribute(name, kind, domain, values.astype(next(wide_enough))))

    read_lists = {*INDEX_NAMES}
    for column in faces.element.properties:
        if column.name == CORNER_UV_NAME and column.count_code and column.code in ("f4", "f8"):
            lengths, numbers = faces.lists(column)
            if (lengths == 2 * mesh.counts).all():
                uvs = Attribute("uv", Kind.UV, Domain.CORNER, numbers.reshape(-1, 2))
                attributes.append(uvs)
                _add_field(fields, (Domain.CORNER, uvs.name), uvs.values, uvs.kind)
                read_lists.add(CORNER_UV_NAME)

    if {column.name for column in vertices.element.properties} & set(NORMALS):
        note_normals(notes)
    lists = [
        f"{name}.{column.name}"
        for name in ("vertex", "face")
        for column in tables[name].element.properties
        if column.count_code and not (name == "face" and column.name in read_lists)
    ]
    notes.left_out("lists", lists)
    element_names = [name for name, table in tables.items() if table.element.n_rows]
    notes.left_out("elements", (name for name in element_names if name not in ("vertex", "face")))
    return Frame(mesh, Surface(attributes=tuple(attributes)), fields, notes)


def _add_field(
    fields: dict[Key, tuple[Values, Field]], key: Key, values: Values, kind: str, role: str = ""
) -> None:
    """Add values under a unique name."""
    while key in fields:
        key = key[0], f"{key[1]}_"
    fields[key] = values, Field(values.dtype, values.shape[1], role, kind)


def _columns(table: PlyTable, domain: Domain) -> Iterator[tuple[str, Kind, Values]]:
    """Yield color, texture coordinates, and all other numbers of the rows of a table."""
    remaining = {
        column.name: column
        for column in table.element.properties
        if not column.count_code and not (domain is Domain.VERTEX and column.name in NOT_ATTRIBUTES)
    }
    for names in (channels[:width] for channels in COLOR_NAMES for width in (4, 3)):
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


FORMATS = (FrameFormat(".ply", "PLY", read_ply, ply_encoder, track_domains=VERTEX_FACE_CORNER),)
