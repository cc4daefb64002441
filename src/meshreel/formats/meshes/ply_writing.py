"""A frame to the bytes of a PLY file, binary little endian.

Written: positions as float or double, polygons, colours and texture coordinates, and single
numbers of vertices and of faces under their own names; tracks in the same way.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.meshes.ply import INDEX_NAMES
from meshreel.formats.meshes.ply_surface import (
    COLOR_NAMES,
    CORNER_UV_NAME,
    NORMALS,
    NORMALS_NAME,
    PASSED_OVER,
    UV_NAMES,
)
from meshreel.formats.notes import (
    note_track_name,
    note_track_type,
    note_unwritten,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.geometry.fans import join_fans
from meshreel.model.geometry.ragged import ragged_indices
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource, value_range

TYPE_NAMES = {
    "<u1": "uchar", "<i1": "char", "<u2": "ushort", "<i2": "short", "<u4": "uint", "<i4": "int",
    "<f4": "float", "<f8": "double",
}  # fmt: skip

HEADER_BEGIN = ("ply", "format binary_little_endian 1.0")


Column = tuple[str, Values]

Lists = tuple[npt.NDArray[np.int64], npt.NDArray[Any]]

RESERVED = {*PASSED_OVER, *COLOR_NAMES, *(name for names in UV_NAMES for name in names)}

RESERVED |= {*INDEX_NAMES, CORNER_UV_NAME}
"""Names of properties that mean something."""

READ_AS = {TrackKind.COLOR: "color", TrackKind.UV: "uv", TrackKind.NORMAL: NORMALS_NAME}
"""What tracks of a kind are called when they are read again."""

NO_PLACE = "vectors, or values of several numbers that are no colours, normals or coordinates"

TOO_MANY = "more than one colour, normal or texture coordinate at a place"

TOO_LARGE = "whole numbers beyond 32 bits"


def ply_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Callable[..., bytes]:
    """A function from the positions and track values of a frame to the bytes of its PLY file.

    Float32 and float64 positions read back exactly. What does not change is written out once.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    notes : list of str, optional
        Gains a sentence on what a PLY file does not hold.
    tracks : mapping of str to TrackSource, optional
        The function takes their values, of shape (N, C), by their names, beside positions of
        shape (V, 3).
    """
    of_verts, of_faces = _held(surface, Domain.VERTEX), _held(surface, Domain.FACE)
    of_corners = _held(surface, Domain.CORNER)
    note_unwritten(surface, (*of_verts, *of_faces, *of_corners), ".ply", notes)
    columns = [column for one in of_verts for column in _columns(one)]
    still = [column for one in of_faces for column in _columns(one)]
    lists = [one.per_item() for one in of_corners]
    held = (*of_verts, *of_faces, *of_corners)
    moving = held_tracks(tracks or {}, held, notes if notes is not None else [])
    own = {domain: [one for one in moving if one.domain is domain] for domain in Domain}
    face_table = _face_table(faces, surface, still, lists)

    def encode(vertices: Vertices, values: Mapping[str, Values] | None = None) -> bytes:
        given = values or {}
        face_header, face_bytes = face_table
        if own[Domain.FACE] or own[Domain.CORNER]:
            of_frame = [pair for one in own[Domain.FACE] for pair in one.columns(given[one.name])]
            pairs = [given[one.name] for one in own[Domain.CORNER]]
            face_header, face_bytes = _face_table(faces, surface, still + of_frame, lists + pairs)
        changing = [pair for one in own[Domain.VERTEX] for pair in one.columns(given[one.name])]
        is_single = vertices.dtype == np.float32
        positions = vertices.astype("f4" if is_single else "f8", copy=False)
        fields = [*zip("xyz", positions.T, strict=True), *columns, *changing]
        rows = np.empty(len(vertices), [(name, _code(values)) for name, values in fields])
        for name, values in fields:
            rows[name] = values
        declared = [f"property {TYPE_NAMES[_code(values)]} {name}" for name, values in fields]
        header = [*HEADER_BEGIN, f"element vertex {len(vertices)}", *declared, *face_header, ""]
        return "\n".join(header).encode("ascii") + rows.tobytes() + face_bytes

    return encode


def _face_table(
    faces: Faces, surface: Surface, columns: list[Column], of_corners: list[Values]
) -> tuple[list[str], bytes]:
    """The lines of the header that declare faces, and the faces."""
    counts = surface.sizes(len(faces)).astype(np.int64)
    lists = [(INDEX_NAMES[0], counts, join_fans(counts, faces))]
    lists += [(CORNER_UV_NAME, 2 * counts, pairs.ravel()) for pairs in of_corners]
    header, fields = [f"element face {len(counts)}"], list[Lists]()
    for name, lengths, values in lists:
        count_code = "<u1" if lengths.max() < 256 else "<i4"
        code = _code(values)
        header.append(f"property list {TYPE_NAMES[count_code]} {TYPE_NAMES[code]} {name}")
        fields += [(np.ones_like(counts), lengths.astype(count_code)), (lengths, values)]
    for name, values in columns:
        header.append(f"property {TYPE_NAMES[_code(values)]} {name}")
        fields.append((np.ones_like(counts), values))
    return [*header, "end_header"], _interleaved(fields)


def _interleaved(fields: list[Lists]) -> bytes:
    """Rows that have of each field its next numbers, as many as its length of the row says."""
    widths = [lengths * values.itemsize for lengths, values in fields]
    row_widths = np.sum(widths, axis=0)
    starts = np.cumsum(row_widths) - row_widths
    table = np.empty(int(row_widths.sum()), np.uint8)
    for (_, values), width in zip(fields, widths, strict=True):
        in_order = np.ascontiguousarray(values, _code(values))
        table[ragged_indices(starts, width)] = in_order.view(np.uint8)
        starts = starts + width
    return table.tobytes()


def _held(surface: Surface, domain: Domain) -> list[Attribute]:
    """The attributes of that domain that a PLY file can hold, in the order of reading."""
    found: dict[str, Attribute] = {}
    for kind in (Kind.COLOR, Kind.UV, Kind.OTHER):
        for one in surface.of_kind(kind):
            key = one.name if kind is Kind.OTHER else kind
            if one.domain is domain and key not in found and _can_be_held(one):
                found[key] = one
    return list(found.values())


def _can_be_held(one: Attribute) -> bool:
    code, width = _code(one.values), one.values.shape[1]
    if one.kind is Kind.COLOR:
        return one.domain is not Domain.CORNER and width in (3, 4) and code != "<i4"
    if one.kind is Kind.UV:
        return one.domain is not Domain.FACE and width == 2 and code in ("<f4", "<f8")
    is_word = re.fullmatch("[!-~]+", one.name) is not None and one.name not in RESERVED
    return one.domain is not Domain.CORNER and width == 1 and is_word


def _columns(one: Attribute) -> Iterator[Column]:
    """The properties that hold an attribute of vertices or faces."""
    names = {Kind.COLOR: COLOR_NAMES, Kind.UV: UV_NAMES[0], Kind.OTHER: (one.name,)}[one.kind]
    return zip(names, one.per_item().T, strict=False)


def _code(values: npt.NDArray[Any]) -> str:
    """Numpy type code, little endian."""
    return f"<{values.dtype.kind}{values.itemsize}"


@dataclass(frozen=True)
class PlyTrack:
    """A track as a PLY file has it.

    Attributes
    ----------
    name : str
        Of the track.
    properties : tuple of str
        One for each number; of corners none, for they are a list.
    dtype : dtype
        Of the numbers in the file.
    """

    name: str
    domain: Domain
    properties: tuple[str, ...]
    dtype: np.dtype[Any]

    def columns(self, values: Values) -> list[tuple[str, Values]]:
        """The properties of a frame, whose values have the shape (N, C)."""
        written = values.astype(self.dtype, copy=False).T
        return list(zip(self.properties, written, strict=True))


def held_tracks(
    tracks: Mapping[str, TrackSource], attributes: Iterable[Attribute], notes: list[str]
) -> list[PlyTrack]:
    """The tracks that a PLY file holds.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    attributes : iterable of Attribute
        Those that it holds, whose properties are taken.
    notes : list of str
        Gains sentences on tracks that are left out, or have another name or type, or a unit.
    """
    taken = {(one.domain, _attribute_key(one)) for one in attributes}
    found: list[PlyTrack] = []
    missing: dict[str, list[str]] = {}
    for name, track in tracks.items():
        properties, dtype = _properties(name, track), _written_type(track)
        if properties is None or dtype is None:
            reason = NO_PLACE if properties is None else TOO_LARGE
            missing.setdefault(reason, []).append(name)
            continue
        is_scalar = len(properties) == 1
        key = properties[0] if is_scalar else READ_AS[track.kind]
        while is_scalar and (track.domain, key) in taken:
            key += "_"
        if (track.domain, key) in taken:
            missing.setdefault(TOO_MANY, []).append(name)
            continue
        taken.add((track.domain, key))
        found.append(PlyTrack(name, track.domain, (key,) if is_scalar else properties, dtype))
        note_track_name(name, key, ".ply", notes)
        note_track_type(name, track.dtype, dtype, notes)
    for reason, names in missing.items():
        note_unwritten_tracks(names, ".ply", notes, reason)
    note_unwritten_units({one.name: tracks[one.name].unit for one in found}, ".ply", notes)
    return found


def _attribute_key(one: Attribute) -> str:
    return {Kind.COLOR: "color", Kind.UV: "uv"}.get(one.kind, one.name)


def _properties(name: str, track: TrackSource) -> tuple[str, ...] | None:
    """The properties that hold a track, none for a list of corners; None if there are none."""
    width, is_corner = track.shape[2], track.domain is Domain.CORNER
    can_be_color = track.dtype.kind == "f" or track.dtype == np.uint8
    if track.kind is TrackKind.COLOR and not is_corner and can_be_color:
        return COLOR_NAMES[:width]
    if track.kind is TrackKind.UV and track.domain is not Domain.FACE:
        return () if is_corner else UV_NAMES[0]
    if track.kind is TrackKind.NORMAL and track.domain is Domain.VERTEX:
        return NORMALS
    if width != 1 or is_corner:
        return None
    word = re.sub("[^!-~]", "_", name)
    return (f"{word}_" if word in RESERVED else word,)


def _written_type(track: TrackSource) -> np.dtype[Any] | None:
    """The type of the numbers in a file; None if none holds them."""
    if track.dtype.str[1:] not in ("i8", "u8"):
        return track.dtype
    low, high = value_range(track)
    limits = np.iinfo(np.int32)
    is_small = bool((low >= limits.min).all() and (high <= limits.max).all())
    return np.dtype(np.int32) if is_small else None
