"""Which tracks a PLY file holds of a frame, and as which properties."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

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
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.surface import Attribute, Domain, Kind
from meshreel.model.tracks import TrackKind, TrackSource, value_range

Values = npt.NDArray[Any]

RESERVED = {*PASSED_OVER, *COLOR_NAMES, *(name for names in UV_NAMES for name in names)}
RESERVED |= {*INDEX_NAMES, CORNER_UV_NAME}
"""Names of properties that mean something."""

READ_AS = {TrackKind.COLOR: "color", TrackKind.UV: "uv", TrackKind.NORMAL: NORMALS_NAME}
"""What tracks of a kind are called when they are read again."""

NO_PLACE = "vectors, or values of several numbers that are no colours, normals or coordinates"
TOO_MANY = "more than one colour, normal or texture coordinate at a place"
TOO_LARGE = "whole numbers beyond 32 bits"


@dataclass(frozen=True)
class PlyTrack:
    """A track as a PLY file has it.

    Attributes
    ----------
    name : str
        Of the track.
    domain : Domain
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
