"""Tracks of ``.npz`` files, named as in `meshreel.formats.arrays.named_arrays`."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_arrays import RESERVED_NAMES, text_array, text_list
from meshreel.formats.arrays.named_tracks import (
    TRACKS_FOLDER,
    Candidate,
    NamedTrack,
    array_names,
    named_tracks,
)
from meshreel.formats.arrays.npz_members import archive_errors, read_array_header
from meshreel.formats.frames.array_frames import Description
from meshreel.model.tracks import TrackSource

Array = npt.NDArray[Any]

NO_NUMBERS = np.dtype(object)
"""Type of members that are not arrays."""


def track_arrays(tracks: Mapping[str, TrackSource]) -> dict[str, Array]:
    """Return the arrays that describe tracks, by name; empty if there are no tracks."""
    if not tracks:
        return {}
    return {
        "track_names": text_array(list(tracks)),
        "track_kinds": text_array([one.kind for one in tracks.values()]),
        "track_domains": text_array([one.domain for one in tracks.values()]),
        "track_units": text_array([one.unit for one in tracks.values()]),
    }


def find_tracks(
    path: Path,
    arrays: Mapping[str, Array],
    positions: str,
    sizes: tuple[int, int],
    about: Description,
    notes: list[str],
) -> dict[str, NamedTrack]:
    """Find the tracks of an archive, without reading their values.

    Parameters
    ----------
    arrays : mapping of str to array
        The named arrays of the archive.
    positions : str
        Name of the array of positions.
    sizes : tuple of int
        Number of frames and vertices.
    notes : list of str
        Receives a sentence on arrays that are not tracks.

    Raises
    ------
    FormatError
        If a described track is missing, or the descriptions differ in number.
    InvalidInputError
        If two tracks share a name.
    """
    described = _described(arrays)
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        candidates = [
            _candidate(archive, info, described)
            for info in archive.infolist()
            for name in [info.filename.removesuffix(".npy")]
            if name != positions and not RESERVED_NAMES.fullmatch(name)
        ]
        if missing := described.keys() - {one.place for one in candidates}:
            raise FormatError(f"has no array {min(missing)!r}, which other arrays refer to")
    return named_tracks(candidates, *sizes, about, notes)


def _candidate(
    archive: zipfile.ZipFile, info: zipfile.ZipInfo, described: Mapping[str, tuple[str, ...]]
) -> Candidate:
    place = info.filename.removesuffix(".npy")
    name, *description = described.get(place, (place.removeprefix(f"{TRACKS_FOLDER}/"),))
    try:
        header = read_array_header(archive, info)
    # Damaged or other members are not part of the sequence; the notes list them.
    except Exception:
        return Candidate(place, name, (), NO_NUMBERS)
    if place == info.filename:  # numpy does not load members without the extension .npy
        return Candidate(place, name, (), NO_NUMBERS)
    return Candidate(place, name, header.shape, header.dtype, *description)


def _described(arrays: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Name, domain, kind and unit of each track, by the name of its array."""
    columns = [
        text_list(arrays, f"track_{what}") for what in ("names", "domains", "kinds", "units")
    ]
    if len({len(column) for column in columns}) > 1:
        counts = ", ".join(str(len(column)) for column in columns)
        raise FormatError(
            f"has {counts} track_names, track_domains, track_kinds and track_units; the numbers "
            "must be equal"
        )
    places = array_names(columns[0])
    if len(places) < len(columns[0]):
        raise FormatError(f"has duplicate track names in {', '.join(columns[0])}")
    rows = zip(*columns, strict=True)
    return {f"{TRACKS_FOLDER}/{places[row[0]]}": row for row in rows}
