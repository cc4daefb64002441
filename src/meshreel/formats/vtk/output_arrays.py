"""Data arrays that VTK writers store for attributes, groups and tracks."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS, TEXTURE_COORDINATES
from meshreel.model.notes import Notes, listed, note_unwritten
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML does not allow."""


@dataclass(frozen=True, eq=False)
class OutputArray:
    """A point or cell array of an output file."""

    name: str
    """Name in the file, unique among point arrays and among cell arrays."""
    domain: Domain
    """Vertices; or faces, or the cells whose surface they are."""
    dtype: np.dtype[Any]
    n_columns: int
    kind: str
    unit: str = ""
    role: str = ""
    """The active attribute of VTK that it is: "TCoords", "Normals" or empty."""
    values: Values | None = None
    """Array of shape (N, C). Values for all frames; None for a track."""
    track: str = ""
    """Name of the track that the array stores; empty for attributes and groups."""


def output_arrays(
    surface: Surface, tracks: Mapping[str, TrackSource], extension: str, notes: Notes
) -> list[OutputArray]:
    """Return the arrays for attributes and groups of vertices and faces or cells, and for tracks.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
        Tracks of vertices, and of faces or cells.
    extension : str
        File extension with the dot.
    notes : Notes
        Receives a sentence for each thing that is left out.
    """
    cell_domain = Domain.FACE if surface.cells is None else Domain.CELL
    attributes = [row for row in surface.attributes if row.domain in (Domain.VERTEX, cell_domain)]
    all_groups = surface.groups if surface.cells is None else ()
    note_unwritten(surface, (*attributes, *all_groups), extension, notes)
    if all_groups:
        names = listed(f"groups {groups.name!r}" for groups in all_groups)
        text = f"labels left out: {names}; {extension} stores only their numbers"
        notes.unwritten("group labels", text)
    arrays = [
        *map(_attribute_array, attributes),
        *(_array(group.name, Domain.FACE, group.numbers[:, None]) for group in all_groups),
        *(_track_array(name, track) for name, track in tracks.items()),
    ]
    return _with_unique_names(arrays)


def _array(
    name: str, domain: Domain, values: Values, kind: Kind = Kind.OTHER, role: str = ""
) -> OutputArray:
    return OutputArray(name, domain, values.dtype, values.shape[1], kind, "", role, values)


def _attribute_array(attribute: Attribute) -> OutputArray:
    role = TEXTURE_COORDINATES if attribute.kind is Kind.UV else ""
    return _array(attribute.name, attribute.domain, attribute.per_item(), attribute.kind, role)


def _track_array(name: str, track: TrackSource) -> OutputArray:
    roles = {TrackKind.NORMAL: NORMALS, TrackKind.UV: TEXTURE_COORDINATES}
    return OutputArray(
        name,
        track.domain,
        track.dtype,
        track.shape[2],
        track.kind,
        xml_text(track.unit),
        roles.get(track.kind, ""),
        track=name,
    )


def _with_unique_names(arrays: list[OutputArray]) -> list[OutputArray]:
    """Give the arrays valid XML names, and each name and role to one array of a domain only."""
    names: set[tuple[Domain, str]] = set()
    roles: set[tuple[Domain, str]] = set()
    unique_arrays = []
    for array in arrays:
        name = xml_text(array.name) or "unnamed"
        while (array.domain, name) in names:
            name += "_"
        role = "" if (array.domain, array.role) in roles else array.role
        names.add((array.domain, name))
        roles.add((array.domain, array.role))
        unique_arrays.append(replace(array, name=name, role=role))
    return unique_arrays


def xml_text(text: str) -> str:
    """Replace characters that XML does not allow by underscores."""
    return NOT_XML.sub("_", text)
