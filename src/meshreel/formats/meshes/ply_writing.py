"""Writer for binary little-endian PLY files, one frame per file.

Writes positions as float or double, polygons, colors as bytes, texture coordinates, and scalars of
vertices and faces under their own names; tracks are written in the same way.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import PLAIN_NAMES
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.kinds import Encode
from meshreel.model.colors import unit_colors
from meshreel.model.geometry.polygons import join_triangles, ragged_indices
from meshreel.model.notes import (
    Notes,
    note_name,
    note_track_type,
    note_unwritten,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import SURFACE_DOMAINS, Attribute, Domain, Kind, Surface
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

RESERVED = {*NOT_ATTRIBUTES, *COLOR_NAMES[0], *(name for names in UV_NAMES for name in names)}

RESERVED |= {*INDEX_NAMES, CORNER_UV_NAME, *(names[1] for names in COLOR_NAMES)}
"""Property names with a fixed meaning. Without green, other names of channels are no color."""

UNSUPPORTED = "vectors, or several components that are not colors, normals or UV coordinates"

TOO_MANY = "more than one color, normal or UV track of each domain"

TOO_LARGE = "integers beyond 32 bits"


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
