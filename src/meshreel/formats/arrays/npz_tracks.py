"""Tracks in an ``.npz`` file, with the names of `meshreel.formats.arrays.named_arrays`."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.arrays.named_arrays import NAMED, text_list, texts_array
from meshreel.formats.arrays.named_tracks import (
    FOLDER,
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
"""Type of what is no array."""


def track_arrays(tracks: Mapping[str, TrackSource]) -> dict[str, Array]:
    """The arrays that describe tracks, by name; none if there are no tracks."""
    if not tracks:
        return {}
    return {
        "track_names": texts_array(list(tracks)),
        "track_kinds": texts_array([one.kind for one in tracks.values()]),
        "track_domains": texts_array([one.domain for one in tracks.values()]),
        "track_units": texts_array([one.unit for one in tracks.values()]),
    }


def find_tracks(
    path: Path,
    arrays: Mapping[str, Array],
    positions: str,
    sizes: tuple[int, int],
    about: Description,
    notes: list[str],
) -> dict[str, NamedTrack]:
    """The tracks of an archive, none of which is read yet.

    Parameters
    ----------
    arrays : mapping of str to array
        Those that the archive has of `meshreel.formats.arrays.named_arrays`.
    positions : str
        The array that holds the positions.
    sizes : tuple of int
        Frames and vertices.
    notes : list of str
        Gains a sentence on arrays that fit no track.

    Raises
    ------
    FormatError
        If a track is described that is not there, or the descriptions are not as many.
    InvalidInputError
        If two tracks have one name.
    """
    described = _described(arrays)
    with archive_errors(path), zipfile.ZipFile(path) as archive:
        candidates = [
            _candidate(archive, info, described)
            for info in archive.infolist()
            for name in [info.filename.removesuffix(".npy")]
            if name != positions and not NAMED.fullmatch(name)
        ]
        if missing := described.keys() - {one.place for one in candidates}:
            raise FormatError(f"has no array {min(missing)!r}, which others speak of")
    return named_tracks(candidates, *sizes, about, notes)


def _candidate(
    archive: zipfile.ZipFile, info: zipfile.ZipInfo, described: Mapping[str, tuple[str, ...]]
) -> Candidate:
    place = info.filename.removesuffix(".npy")
    name, *said = described.get(place, (place.removeprefix(f"{FOLDER}/"),))
    try:
        header = read_array_header(archive, info)
    # What is no array, or a damaged one, is none of the sequence: the notes name it.
    except Exception:
        return Candidate(place, name, (), NO_NUMBERS)
    if place == info.filename:  # numpy itself does not read an array without the ending
        return Candidate(place, name, (), NO_NUMBERS)
    return Candidate(place, name, header.shape, header.dtype, *said)


def _described(arrays: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Name, domain, kind and unit of tracks, by the names of their arrays."""
    columns = [
        text_list(arrays, f"track_{what}") for what in ("names", "domains", "kinds", "units")
    ]
    if len({len(column) for column in columns}) > 1:
        counts = ", ".join(str(len(column)) for column in columns)
        raise FormatError(
            f"has {counts} track_names, track_domains, track_kinds and track_units; they must be "
            "as many"
        )
    places = array_names(columns[0])
    if len(places) < len(columns[0]):
        raise FormatError(f"has a track name twice among {', '.join(columns[0])}")
    rows = zip(*columns, strict=True)
    return {f"{FOLDER}/{places[row[0]]}": row for row in rows}
