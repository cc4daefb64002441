"""Arrays that every frame has for itself, as in files of VTK, to tracks that are read on demand."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.stored_tracks import StoredTrack, kind_said
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.model.surface import Domain
from meshreel.model.tracks import MAX_COLUMNS, NUMBER_TYPES, TrackKind, default_kind
from meshreel.runtime.counting import plural

Key = tuple[Domain, str]
"""Where the values of an array are, and its name."""

NORMALS = "Normals"
UV_NAMES = {"uv", "uvmap", "st", "tcoords", "texturecoordinates", "texture coordinates"}
COLOR_NAMES = {"color", "colors", "colour", "colours", "rgb", "rgba", "cd"}

SUFFIXES = {Domain.VERTEX: "_", Domain.FACE: " (faces)", Domain.CORNER: " (corners)"}
"""What tells names of arrays apart that are there at several places."""

UNIT_LENGTH = 1e-3
"""How far the length of normals may be from 1, as rounded numbers of files are."""


@dataclass(frozen=True, eq=False)
class Field:
    """What is known of an array of a frame without its numbers.

    Parameters
    ----------
    n_columns : int
        Numbers of each value.
    role : str, default ""
        What it is active as: "TCoords", "Normals" and others.
    kind, unit : str, default ""
        What the file says of it as a track.
    is_track : bool, default False
        Whether the file says that it is a track, even if it never changes.
    """

    dtype: np.dtype[Any]
    n_columns: int
    role: str = ""
    kind: str = ""
    unit: str = ""
    is_track: bool = False


Fields = Mapping[Key, tuple[Values, Field]]
"""The arrays of a frame on the surface: numbers, of shape (N,) or (N, C), and what is known."""

ReadField = Callable[[int, Key], Values]
"""Gives the numbers of an array in a frame on the surface, of shape (N,) or (N, C)."""


def add_field(fields: dict[Key, Field], key: Key, field: Field) -> None:
    """Add an array to those of a frame.

    Raises
    ------
    InvalidInputError
        If there is one of that name.
    """
    if key in fields:
        where = "points" if key[0] is Domain.VERTEX else "cells"
        raise InvalidInputError(
            f"has two arrays {key[1]!r} at {where} in a frame, of {fields[key].n_columns} and of "
            f"{field.n_columns} numbers; rename one of the two"
        )
    fields[key] = field


def field_tracks(
    frames: Sequence[Mapping[Key, Field]],
    sizes: Mapping[Domain, int],
    read: ReadField,
    notes: list[str],
) -> dict[str, StoredTrack]:
    """The tracks that arrays of frames are, by their names.

    An array that is not in all frames is NaN in the others, and of float64 if its numbers are
    whole. Of two arrays of one name, at points and at cells, that at cells is called "NAME
    (faces)". The notes say so.

    Parameters
    ----------
    frames : sequence of mappings
        Arrays of each frame.
    sizes : mapping of Domain to int
        Vertices, faces and, where arrays are of corners, these.
    read : function of the number of a frame and the key of an array in it
    """
    found: dict[str, StoredTrack] = {}
    for key in dict.fromkeys(key for frame in frames for key in frame):
        track = _track(key, frames, sizes[key[0]], read, notes)
        if track is None:
            continue
        name = key[1]
        while name in found:
            name += SUFFIXES[key[0]]
        if name != key[1]:
            where = "at points and at cells" if key[0] is Domain.FACE else "also at corners"
            notes.append(f"{key[1]!r} is {where}; that of {plural(key[0])} is called {name!r}")
        found[name] = track
    return found


def _track(
    key: Key,
    frames: Sequence[Mapping[Key, Field]],
    n_items: int,
    read: ReadField,
    notes: list[str],
) -> StoredTrack | None:
    has = [key in frame for frame in frames]
    fields = [frame[key] for frame in frames if key in frame]
    widths = sorted({field.n_columns for field in fields})
    if len(widths) > 1:
        several = " and of ".join(map(str, widths))
        note_left_out(notes, f"{key[1]!r}, of {several} numbers in different frames")
        return None
    if not 1 <= widths[0] <= MAX_COLUMNS or any(one.dtype not in NUMBER_TYPES for one in fields):
        note_kinds(notes, f"fields of text, or of more than {MAX_COLUMNS} numbers", [key[1]])
        return None
    dtype = np.result_type(*(field.dtype for field in fields))
    if not all(has):
        is_float = dtype.kind == "f"
        dtype = dtype if is_float else np.dtype(np.float64)
        notes.append(
            f"{key[1]!r} is in {sum(has)} of {len(has)} frames, and NaN in the others"
            + ("" if is_float else ", as float64")
        )
    shape = len(frames), n_items, widths[0]

    def read_range(start: int, stop: int) -> Values:
        values: Values = np.full((stop - start, *shape[1:]), np.nan if not all(has) else 0, dtype)
        for index in range(start, stop):
            if has[index]:
                values[index - start] = read(index, key).reshape(shape[1:])
        return values

    kind = _kind(key[1], fields[0], dtype, read_range, len(frames))
    return StoredTrack(key[0], kind, fields[0].unit, dtype, shape, read_range)


def _kind(
    name: str,
    field: Field,
    dtype: np.dtype[Any],
    read: Callable[[int, int], Values],
    n_frames: int,
) -> TrackKind:
    """What an array means, by what the file says of it, its name and its numbers."""
    width, is_float, lower = field.n_columns, dtype.kind == "f", name.lower()
    if said := kind_said(field.kind, width, dtype):
        return said
    if width in (3, 4) and (dtype == np.uint8 or (is_float and lower in COLOR_NAMES)):
        return TrackKind.COLOR
    if width == 2 and is_float and lower in UV_NAMES:
        return TrackKind.UV
    if width == 3 and is_float and (lower == "normals" or field.role == NORMALS):
        is_unit = all(_are_unit(read(index, index + 1)) for index in range(n_frames))
        return TrackKind.NORMAL if is_unit else TrackKind.VECTOR
    return default_kind(width)


def _are_unit(values: Values) -> bool:
    """Whether vectors have the length 1, but for those that are missing."""
    lengths = np.linalg.norm(values.astype(np.float64), axis=-1)
    return bool((np.isnan(lengths) | (abs(lengths - 1) <= UNIT_LENGTH)).all())
