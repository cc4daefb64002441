"""Which tracks an OBJ file holds of a frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.meshes.obj_surface import NORMALS_NAME
from meshreel.formats.notes import (
    note_track_name,
    note_track_type,
    note_unwritten_tracks,
    note_unwritten_units,
)
from meshreel.model.surface import Attribute, Domain
from meshreel.model.tracks import TrackKind, TrackSource

Values = npt.NDArray[Any]

READ_AS = {TrackKind.COLOR: "color", TrackKind.UV: "uv", TrackKind.NORMAL: NORMALS_NAME}
"""What tracks of a kind are called when they are read again."""

NO_PLACE = "tracks but colours of vertices, normals and texture coordinates"
TOO_MANY = "more than one colour, normal or texture coordinate at a place"


@dataclass(frozen=True)
class ObjTrack:
    """A track as an OBJ file has it: float32, colours of 0..1.

    Attributes
    ----------
    name : str
        Of the track.
    domain : Domain
    """

    name: str
    domain: Domain

    def shown(self, values: Values) -> Values:
        """Values of a frame, of shape (N, C), as they are written."""
        scaled = values / 255 if values.dtype == np.uint8 else values
        return scaled.astype(np.float32)


def held_tracks(
    tracks: Mapping[str, TrackSource],
    uv: Attribute | None,
    colors: Attribute | None,
    notes: list[str],
) -> dict[TrackKind, ObjTrack]:
    """The tracks that an OBJ file holds, one of a kind.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    uv, colors : Attribute or None
        What it holds already.
    notes : list of str
        Gains sentences on tracks that are left out, or have another name or type, or a unit.
    """
    held = {TrackKind.UV: uv, TrackKind.COLOR: colors}
    taken = {kind for kind, one in held.items() if one is not None}
    found: dict[TrackKind, ObjTrack] = {}
    missing: dict[str, list[str]] = {}
    for name, track in tracks.items():
        if not _has_place(track):
            missing.setdefault(NO_PLACE, []).append(name)
        elif track.kind in taken:
            missing.setdefault(TOO_MANY, []).append(name)
        else:
            taken.add(track.kind)
            found[track.kind] = ObjTrack(name, track.domain)
            note_track_name(name, READ_AS[track.kind], ".obj", notes)
            note_track_type(name, track.dtype, np.dtype(np.float32), notes)
            if track.kind is TrackKind.COLOR and track.shape[2] > len("rgb"):
                notes.append(f"the fourth number of track {name!r} left out: .obj has three")
    for reason, names in missing.items():
        note_unwritten_tracks(names, ".obj", notes, reason)
    units = {one.name: tracks[one.name].unit for one in found.values()}
    note_unwritten_units(units, ".obj", notes)
    return found


def _has_place(track: TrackSource) -> bool:
    can_be_color = track.dtype.kind == "f" or track.dtype == np.uint8
    if track.kind is TrackKind.COLOR:
        return track.domain is Domain.VERTEX and can_be_color
    return track.kind in (TrackKind.UV, TrackKind.NORMAL) and track.domain is not Domain.FACE
