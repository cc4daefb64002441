"""What files of VTK and XDMF hold of a sequence beside its positions, as named arrays."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.notes import listed, note_unwritten
from meshreel.formats.vtk.data_arrays import TEXTURE_COORDINATES
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource

FRAME_RATE = 24.0  # of what has none

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that no XML may have."""


@dataclass(frozen=True, eq=False)
class WrittenArray:
    """An array at points or cells.

    Parameters
    ----------
    name : str
        As in the file, where no other at the same place has it.
    domain : Domain
        Vertices or faces.
    dtype : dtype
    n_columns : int
    kind, unit : str
    role : str
        What it is active as: "TCoords", "Normals" or nothing.
    values : array of shape (N, C), optional
        Of all frames; of a track None.
    track : str, default ""
        The name of the track that it is.
    """

    name: str
    domain: Domain
    dtype: np.dtype[Any]
    n_columns: int
    kind: str
    unit: str = ""
    role: str = ""
    values: Values | None = None
    track: str = ""


def written_arrays(
    surface: Surface, tracks: Mapping[str, TrackSource], ending: str, notes: list[str]
) -> list[WrittenArray]:
    """Attributes and groups of vertices and faces, and tracks.

    Parameters
    ----------
    surface : Surface
    tracks : mapping of str to TrackSource
        Of vertices and faces.
    ending : str
        Of the file, with the dot.
    notes : list of str
        Gains sentences on what is left out.
    """
    held = [one for one in surface.attributes if one.domain is not Domain.CORNER]
    note_unwritten(surface, (*held, *surface.groups), ending, notes)
    if surface.groups:
        names = listed(groups.name for groups in surface.groups)
        notes.append(f"labels of groups left out, which are numbers in {ending}: {names}")
    found = [
        *map(_of_attribute, held),
        *(_array(one.name, Domain.FACE, one.numbers[:, None]) for one in surface.groups),
        *(_of_track(name, track) for name, track in tracks.items()),
    ]
    return _told_apart(found)


def _array(
    name: str, domain: Domain, values: Values, kind: Kind = Kind.OTHER, role: str = ""
) -> WrittenArray:
    return WrittenArray(name, domain, values.dtype, values.shape[1], kind, "", role, values)


def _of_attribute(one: Attribute) -> WrittenArray:
    role = TEXTURE_COORDINATES if one.kind is Kind.UV else ""
    return _array(one.name, one.domain, one.per_item(), one.kind, role)


def _of_track(name: str, track: TrackSource) -> WrittenArray:
    roles = {TrackKind.NORMAL: NORMALS, TrackKind.UV: TEXTURE_COORDINATES}
    return WrittenArray(
        name,
        track.domain,
        track.dtype,
        track.shape[2],
        track.kind,
        xml_text(track.unit),
        roles.get(track.kind, ""),
        track=name,
    )


def _told_apart(arrays: list[WrittenArray]) -> list[WrittenArray]:
    """With names that XML may have, each of which is there once at its place, and so is a role."""
    taken: set[tuple[Domain, str]] = set()
    roles: set[tuple[Domain, str]] = set()
    found = []
    for one in arrays:
        name = xml_text(one.name) or "unnamed"
        while (one.domain, name) in taken:
            name += "_"
        role = "" if (one.domain, one.role) in roles else one.role
        taken.add((one.domain, name))
        roles.add((one.domain, one.role))
        found.append(replace(one, name=name, role=role))
    return found


def xml_text(text: str) -> str:
    """A text whose characters XML may have."""
    return NOT_XML.sub("_", text)
