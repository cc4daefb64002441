"""Polygon File Format (PLY): the mesh and attributes of one frame.

Reads ASCII and both binary encodings, any additional elements and properties, and polygons.
Positions keep the declared type: double stays float64, and integers become a float type that
represents them. Colors, texture coordinates, and every other number of vertices and faces under its
own name are attributes, as are corner texture coordinates in the face list ``texcoord``. Normals
are read if they change between frames; other lists and elements are ignored.

Writes binary little-endian files: positions as float or double, polygons, colors as bytes, texture
coordinates, and scalars of vertices and faces under their own names; tracks in the same way.

trimesh is not used: it splits vertices at texture seams, reorders faces if quads and triangles are
mixed, cannot read binary lists of varying length, and raises numpy errors on damaged files.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.frames.field_tracks import NORMALS_NAME, PLAIN_NAMES, Field, Key
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import VERTEX_FACE_CORNER, Encode, FrameFormat
from meshreel.formats.meshes.ply_tables import PlyProperty, PlyTable, read_ply_tables
from meshreel.formats.surfaces.polygons import polygon_mesh
from meshreel.model.colors import unit_colors
from meshreel.model.geometry.polygons import join_triangles, ragged_indices
from meshreel.model.notes import (
    Notes,
    note_name,
    note_normals,
    note_track_type,
    note_unwritten,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import SURFACE_DOMAINS, VALUE_TYPES, Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource, is_color, track_blocks, value_range

INDEX_NAMES = ("vertex_indices", "vertex_index")
COLOR_NAMES = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("r", "g", "b", "a"),
)
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
CORNER_UV_NAME = "texcoord"
NORMALS = ("nx", "ny", "nz")
NOT_ATTRIBUTES = ("x", "y", "z", *NORMALS)

TYPE_NAMES = {
    "<u1": "uchar", "<i1": "char", "<u2": "ushort", "<i2": "short", "<u4": "uint", "<i4": "int",
    "<f4": "float", "<f8": "double",
}  # fmt: skip

Column = tuple[str, Values]
"""Name and values of a property."""

RESERVED = {*NOT_ATTRIBUTES, *INDEX_NAMES, CORNER_UV_NAME, *COLOR_NAMES[0]}
RESERVED |= {*(names[1] for names in COLOR_NAMES), *(name for names in UV_NAMES for name in names)}
"""Property names with a fixed meaning. Without green, other names of channels are no color."""

UNSUPPORTED = "vectors, or several components that are not colors, normals or UV coordinates"

TOO_MANY = "more than one color, normal or UV track of each domain"

TOO_LARGE = "integers beyond 32 bits"


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
        for name, kind, values in _read_columns(table, domain):
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


def _read_columns(table: PlyTable, domain: Domain) -> Iterator[tuple[str, Kind, Values]]:
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


def ply_encoder(stream: FrameStream) -> Encode:
    """Return a function that encodes a frame as a PLY file.

    Float32 and float64 positions round-trip exactly. Constant data is encoded once.
    """
    faces, surface = stream.faces, stream.surface
    attributes = {domain: _writable_attributes(surface, domain) for domain in SURFACE_DOMAINS}
    all_attributes = [attribute for group in attributes.values() for attribute in group]
    note_unwritten(surface, all_attributes, ".ply", stream.notes)
    tracks = select_tracks(stream.tracks, all_attributes, stream.notes)
    vertex_columns, face_columns = (
        [column for attribute in attributes[domain] for column in _columns(attribute, stream.notes)]
        for domain in (Domain.VERTEX, Domain.FACE)
    )
    corner_values = [attribute.per_item() for attribute in attributes[Domain.CORNER]]
    constant_face_table = _face_table(faces, surface, face_columns, corner_values)
    has_face_tracks = any(track.domain is not Domain.VERTEX for track in tracks)

    def encode(vertices: Vertices, values: Mapping[str, Values]) -> bytes:
        track_columns: dict[Domain, list[Column]] = {Domain.VERTEX: [], Domain.FACE: []}
        track_corner_values = []
        for track in tracks:
            if track.domain is Domain.CORNER:
                track_corner_values.append(values[track.name])
            else:
                columns = _converted(values[track.name], track.dtype).T
                track_columns[track.domain] += zip(track.properties, columns, strict=True)
        face_header, face_bytes = constant_face_table
        if has_face_tracks:
            face_header, face_bytes = _face_table(
                faces,
                surface,
                face_columns + track_columns[Domain.FACE],
                corner_values + track_corner_values,
            )

        positions = vertices.astype("f4" if vertices.dtype == np.float32 else "f8", copy=False)
        fields = [*zip("xyz", positions.T, strict=True), *vertex_columns]
        fields += track_columns[Domain.VERTEX]
        rows = np.empty(len(vertices), [(name, _code(column)) for name, column in fields])
        for name, column in fields:
            rows[name] = column
        properties = [f"property {TYPE_NAMES[_code(column)]} {name}" for name, column in fields]
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        text = "\n".join([*header, *properties, *face_header, ""])
        return text.encode("ascii") + rows.tobytes() + face_bytes

    return encode


def _face_table(
    faces: Faces, surface: Surface, columns: list[Column], corner_values: list[Values]
) -> tuple[list[str], bytes]:
    """Return the end of the header and the faces, with further properties and UVs of corners."""
    counts = surface.sizes(len(faces)).astype(np.int64)
    lists = [(INDEX_NAMES[0], counts, join_triangles(counts, faces))]
    lists += [(CORNER_UV_NAME, 2 * counts, pairs.ravel()) for pairs in corner_values]
    header = [f"element face {len(counts)}"]
    fields: list[tuple[npt.NDArray[np.int64], npt.NDArray[Any]]] = []  # lengths in rows, values
    for name, lengths, values in lists:
        count_code = "<u1" if lengths.max() < 256 else "<i4"
        code = _code(values)
        header.append(f"property list {TYPE_NAMES[count_code]} {TYPE_NAMES[code]} {name}")
        fields += [(np.ones_like(counts), lengths.astype(count_code)), (lengths, values)]
    for name, values in columns:
        header.append(f"property {TYPE_NAMES[_code(values)]} {name}")
        fields.append((np.ones_like(counts), values))

    # Row by row, the values of each field in order.
    widths = [lengths * values.itemsize for lengths, values in fields]
    row_widths = np.sum(widths, axis=0)
    starts = np.cumsum(row_widths) - row_widths
    table = np.empty(int(row_widths.sum()), np.uint8)
    for (_, values), width in zip(fields, widths, strict=True):
        in_order = np.ascontiguousarray(values, _code(values))
        table[ragged_indices(starts, width)] = in_order.view(np.uint8)
        starts = starts + width
    return [*header, "end_header"], table.tobytes()


def _writable_attributes(surface: Surface, domain: Domain) -> list[Attribute]:
    """Attributes of a domain that a PLY file can store, in reading order."""
    writable: dict[str, Attribute] = {}
    for kind in (Kind.COLOR, Kind.UV, Kind.OTHER):
        for attribute in surface.of_kind(kind):
            if attribute.domain is domain and _is_writable(attribute):
                writable.setdefault(_attribute_key(attribute), attribute)
    return list(writable.values())


def _is_writable(attribute: Attribute) -> bool:
    code, width = _code(attribute.values), attribute.values.shape[1]
    if attribute.kind is Kind.COLOR:
        return attribute.domain is not Domain.CORNER and width in (3, 4) and code != "<i4"
    if attribute.kind is Kind.UV:
        return attribute.domain is not Domain.FACE and width == 2 and code in ("<f4", "<f8")
    is_word = re.fullmatch("[!-~]+", attribute.name) and attribute.name not in RESERVED
    return attribute.domain is not Domain.CORNER and width == 1 and bool(is_word)


def _columns(attribute: Attribute, notes: Notes) -> Iterator[Column]:
    """Property columns of a vertex or face attribute."""
    names = {Kind.COLOR: COLOR_NAMES[0], Kind.UV: UV_NAMES[0]}
    values = attribute.per_item()
    if attribute.kind is Kind.COLOR:
        values = _converted(values, _color_type(attribute.name, [values], notes))
    return zip(names.get(attribute.kind, (attribute.name,)), values.T, strict=False)


def _color_type(name: str, tables: Iterable[Values], notes: Notes) -> np.dtype[Any]:
    """Return the number type of colors in the file: bytes, which all programs read, if possible."""
    rounding = 0.0
    for numbers in (255 * unit_colors(colors) for colors in tables):
        if not ((numbers >= 0) & (numbers <= 255)).all():
            text = f"colors {name!r} exceed 0..1; written as floats, which few programs read"
            notes.changed(name, text)
            return numbers.dtype
        rounding = max(rounding, float(np.abs(numbers - np.rint(numbers)).max(initial=0)))
    if rounding > 1e-3:  # more than that of float32
        notes.changed(name, f"colors {name!r} are rounded to bytes, which all programs read")
    return np.dtype(np.uint8)


def _converted(values: Values, dtype: np.dtype[Any]) -> Values:
    """Return values in the number type of the file; colors become bytes."""
    is_rounded = dtype == np.uint8 and values.dtype.kind == "f"
    return (np.rint(255 * values) if is_rounded else values).astype(dtype, copy=False)


def _code(values: npt.NDArray[Any]) -> str:
    """Little-endian numpy type code."""
    return f"<{values.dtype.kind}{values.itemsize}"


@dataclass(frozen=True)
class PlyTrack:
    """How a track is stored in a PLY file."""

    name: str
    """Name of the track."""
    domain: Domain
    properties: tuple[str, ...]
    """One for each component; empty for corner tracks, which are stored as a list."""
    dtype: np.dtype[Any]
    """Type of the numbers in the file."""


def select_tracks(
    tracks: Mapping[str, TrackSource], attributes: Iterable[Attribute], notes: Notes
) -> list[PlyTrack]:
    """Return the tracks that a PLY file can store.

    Parameters
    ----------
    attributes : iterable of Attribute
        Attributes that it stores; their property names are reserved.
    notes : Notes
        Receives sentences on tracks that are left out, renamed, converted, or lose their unit.
    """
    used_keys = {(attribute.domain, _attribute_key(attribute)) for attribute in attributes}
    ply_tracks: list[PlyTrack] = []
    missing: dict[str, list[str]] = {}
    for name, track in tracks.items():
        properties, dtype = _properties(name, track), _written_type(track)
        if properties is None or dtype is None:
            reason = UNSUPPORTED if properties is None else TOO_LARGE
            missing.setdefault(reason, []).append(name)
            continue
        is_scalar = len(properties) == 1
        key = properties[0] if is_scalar else PLAIN_NAMES[track.kind]
        while is_scalar and (track.domain, key) in used_keys:
            key += "_"
        if (track.domain, key) in used_keys:
            missing.setdefault(TOO_MANY, []).append(name)
            continue
        used_keys.add((track.domain, key))
        if track.kind is TrackKind.COLOR and track.dtype.kind == "f":
            dtype = _color_type(name, (block for _, block in track_blocks(track)), notes)
        else:
            note_track_type(name, track.dtype, dtype, notes)
        ply_tracks.append(PlyTrack(name, track.domain, (key,) if is_scalar else properties, dtype))
        note_name("track", name, key, ".ply", notes)
    for reason, names in missing.items():
        note_unwritten_tracks(names, ".ply", notes, reason)
    units = {track.name: tracks[track.name].unit for track in ply_tracks}
    note_unwritten_units(units, ".ply", notes)
    return ply_tracks


def _attribute_key(attribute: Attribute) -> str:
    """Return the name under which an attribute is read back."""
    return PLAIN_NAMES.get(attribute.kind, attribute.name)


def _properties(name: str, track: TrackSource) -> tuple[str, ...] | None:
    """Properties for a track, empty for a corner list; None if PLY cannot store the track."""
    width, is_corner = track.shape[2], track.domain is Domain.CORNER
    if is_color(track.kind, track.dtype) and not is_corner:
        return COLOR_NAMES[0][:width]
    if track.kind is TrackKind.UV and track.domain is not Domain.FACE:
        return () if is_corner else UV_NAMES[0]
    if track.kind is TrackKind.NORMAL and track.domain is Domain.VERTEX:
        return NORMALS
    if width != 1 or is_corner:
        return None
    word = re.sub("[^!-~]", "_", name)
    return (f"{word}_" if word in RESERVED else word,)


def _written_type(track: TrackSource) -> np.dtype[Any] | None:
    """Type of the numbers in the file; None if no PLY type can represent them."""
    if track.dtype.str[1:] not in ("i8", "u8"):
        return track.dtype
    low, high = value_range(track)
    limits = np.iinfo(np.int32)
    is_small = bool((low >= limits.min).all() and (high <= limits.max).all())
    return np.dtype(np.int32) if is_small else None


FORMATS = (FrameFormat(".ply", "PLY", read_ply, ply_encoder, track_domains=VERTEX_FACE_CORNER),)
