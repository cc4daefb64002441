"""Tracks from arrays that each frame file stores, such as VTK point data, read lazily."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.stored_frames import StoredTrack, parse_track_kind
from meshreel.model.colors import unit_colors
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import MAX_COLUMNS, NUMBER_TYPES, TrackKind, default_kind
from meshreel.runtime.counting import plural

Key = tuple[Domain, str]
"""Domain and name of an array."""

NORMALS, TEXTURE_COORDINATES = "Normals", "TCoords"
"""Active attributes of VTK, which also name the roles of quantities of other formats."""

UV_NAMES = {"uv", "uvmap", "st", "tcoords", "texturecoordinates", "texture coordinates"}
NORMALS_NAME = "normals"
COLOR_NAMES = {"color", "colors", "colour", "colours", "rgb", "rgba", "cd"}

PLAIN_NAMES: Mapping[str, str] = {
    TrackKind.COLOR: "color",
    TrackKind.UV: "uv",
    TrackKind.NORMAL: NORMALS_NAME,
}
"""Names of the kinds that formats without names of tracks store."""

SUFFIXES = {
    Domain.VERTEX: "_",
    Domain.FACE: " (faces)",
    Domain.CORNER: " (corners)",
    Domain.CELL: " (cells)",
}
"""Suffixes that make names unique if arrays of several domains share a name."""

UNIT_LENGTH = 1e-3
"""Maximum deviation of unit normals from length 1, to allow for rounded values in files."""


@dataclass(frozen=True, eq=False)
class Field:
    """Description of an array of a frame, without its values."""

    dtype: np.dtype[Any]
    n_columns: int
    """Number of components."""
    role: str = ""
    """Its role as an active attribute of VTK, such as "TCoords" or "Normals"."""
    kind: str = ""
    """Kind that the file declares, for an attribute or a track."""
    unit: str = ""
    is_track: bool = False
    """Whether the file declares it a track, even if its values never change."""


Fields = Mapping[Key, tuple[Values, Field]]
"""Values, of shape (N,) or (N, C), and descriptions of the arrays of a frame."""

ReadField = Callable[[int, Key], Values]
"""Reads the values of an array in a frame, of shape (N,) or (N, C)."""


def add_field(fields: dict[Key, Field], key: Key, field: Field) -> None:
    """Add the description of an array to those of a frame.

    Raises
    ------
    InvalidInputError
        If the domain already has an array of that name.
    """
    if key in fields:
        location = "points" if key[0] is Domain.VERTEX else "cells"
        raise InvalidInputError(
            f"has two arrays {key[1]!r} at {location} in a frame, with {fields[key].n_columns} and "
            f"{field.n_columns} components; rename one of them"
        )
    fields[key] = field


def field_tracks(
    frames: Sequence[Mapping[Key, Field]],
    sizes: Mapping[Domain, int],
    read: ReadField,
    notes: Notes,
) -> dict[str, StoredTrack]:
    """Return the tracks that consist of the arrays of all frames, by name.

    A track is NaN in frames without its array; integers become float64 then. If a point array and
    a cell array share a name, the track of the cells is called "NAME (faces)", or "NAME (cells)" of
    a volume mesh. Notes report both.

    Parameters
    ----------
    frames : sequence of mappings
        Descriptions of the arrays of each frame.
    sizes : mapping of Domain to int
        Number of vertices, faces and, if there are corner arrays, corners.
    read : function of a frame number and the key of an array in that frame
    """
    tracks: dict[str, StoredTrack] = {}
    for key in dict.fromkeys(key for frame in frames for key in frame):
        track = _track(key, frames, sizes[key[0]], read, notes)
        if track is None:
            continue
        name = key[1]
        while name in tracks:
            name += SUFFIXES[key[0]]
        if name != key[1]:
            location = "also at corners" if key[0] is Domain.CORNER else "at points and at cells"
            text = f"{key[1]!r} is {location}; the one of {plural(key[0])} is called {name!r}"
            notes.changed(name, text)
        tracks[name] = track
    return tracks


def _track(
    key: Key,
    frames: Sequence[Mapping[Key, Field]],
    n_items: int,
    read: ReadField,
    notes: Notes,
) -> StoredTrack | None:
    present = [key in frame for frame in frames]
    fields = [frame[key] for frame in frames if key in frame]
    widths = sorted({field.n_columns for field in fields})
    if len(widths) > 1:
        widths_text = " or ".join(map(str, widths))
        notes.left_out(f"{key[1]!r}, which has {widths_text} components in different frames")
        return None
    if not 1 <= widths[0] <= MAX_COLUMNS or any(
        field.dtype not in NUMBER_TYPES for field in fields
    ):
        notes.left_out(f"fields of text, or with more than {MAX_COLUMNS} components", [key[1]])
        return None
    dtype = given = np.result_type(*(field.dtype for field in fields))
    if not all(present):
        is_float = dtype.kind == "f"
        dtype = dtype if is_float else np.dtype(np.float64)
        text = f"{key[1]!r} is in {sum(present)} of {len(present)} frames, and NaN in the others"
        text += "" if is_float else ", as float64"
        notes.changed(key[1], text)
    if dtype.kind == "f" and any(field.dtype.name in ("int64", "uint64") for field in fields):
        text = f"{key[1]!r} becomes {dtype}, which rounds integers above 2^53"
        notes.changed(key[1], text)
    shape = len(frames), n_items, widths[0]
    stored = (read(index, key) for index, is_present in enumerate(present) if is_present)
    kind = _kind(key[1], fields[0], given, stored)
    is_unit_color = kind is TrackKind.COLOR and dtype.kind == "f"

    def read_range(start: int, stop: int) -> Values:
        values: Values = np.full((stop - start, *shape[1:]), 0 if all(present) else np.nan, dtype)
        for index in range(start, stop):
            if present[index]:
                part = read(index, key)
                part = unit_colors(part) if is_unit_color else part
                values[index - start] = part.reshape(shape[1:])
        return values

    return StoredTrack(key[0], kind, fields[0].unit, dtype, shape, read_range)


def attribute_kind(name: str, field: Field, dtype: np.dtype[Any]) -> Kind:
    """Return the kind of attribute that an array represents, given its number type."""
    name, is_float = name.lower(), dtype.kind == "f"
    is_uv = field.kind == Kind.UV or field.role == TEXTURE_COORDINATES or name in UV_NAMES
    if field.n_columns == 2 and is_float and is_uv:
        return Kind.UV
    is_color = dtype == np.uint8 or (is_float and (field.kind == Kind.COLOR or name in COLOR_NAMES))
    return Kind.COLOR if field.n_columns in (3, 4) and is_color else Kind.OTHER


def _kind(
    name: str,
    field: Field,
    dtype: np.dtype[Any],
    frames: Iterable[Values],
) -> TrackKind:
    """Infer the track kind from the declared kind, the name and the values of an array."""
    width = field.n_columns
    if declared_kind := parse_track_kind(field.kind, width, dtype):
        return declared_kind
    if (kind := attribute_kind(name, field, dtype)) is not Kind.OTHER:
        return TrackKind(kind)
    is_normal = name.lower() == NORMALS_NAME or field.role == NORMALS
    if width == 3 and dtype.kind == "f" and is_normal:
        return TrackKind.NORMAL if all(map(_are_unit, frames)) else TrackKind.VECTOR
    return default_kind(width)


def _are_unit(values: Values) -> bool:
    """Whether all vectors have length 1; missing ones (NaN) are ignored."""
    lengths = np.linalg.norm(values.reshape(-1, 3).astype(np.float64), axis=1)
    return bool((np.isnan(lengths) | (abs(lengths - 1) <= UNIT_LENGTH)).all())
