"""Detection of the arrays that are tracks, in NumPy archives and HDF5 files.

Candidates are arrays next to the positions, of shape (T, N) or (T, N, C) for T frames and N
vertices, faces or corners, and arrays in the folder ``tracks``. The domain, kind and unit that a
file declares take precedence; otherwise the size selects the domain.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.stored_frames import Description, StoredTrack, parse_track_kind
from meshreel.model.notes import Note, NoteKind, Notes, listed
from meshreel.model.surface import Domain
from meshreel.model.tracks import (
    MAX_COLUMNS,
    NUMBER_TYPES,
    TrackKind,
    default_kind,
    describe_sizes,
    domain_sizes,
)

TRACKS_FOLDER = "tracks"
"""Folder or group for tracks, next to the positions."""

WIDENED_TYPES: dict[np.dtype[Any], np.dtype[Any]] = {
    np.dtype(np.bool_): np.dtype(np.uint8),
    np.dtype(np.float16): np.dtype(np.float32),
}
"""Lossless conversions of types that tracks do not support."""

ReadNumbers = Callable[[int, int], npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """An array of a file that may be a track."""

    path: str
    """Path in the file."""
    name: str
    """Name of the track."""
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    """Type in the file, in any byte order."""
    domain: str = ""
    kind: str = ""
    unit: str = ""
    """As the file declares them; empty if it does not."""


@dataclass(frozen=True, eq=False)
class NamedTrack:
    """An array of a file that is a track."""

    path: str
    """Path of its array in the file."""
    domain: Domain
    kind: TrackKind
    unit: str
    dtype: np.dtype[Any]
    """Of the track."""
    shape: tuple[int, int, int]
    """(T, N, C)."""

    def stored_track(self, read: ReadNumbers) -> StoredTrack:
        """Return the track, given a function that reads frames start..stop - 1 of its array."""
        read_values = partial(self._values, read)  # can be pickled, unlike a closure
        return StoredTrack(self.domain, self.kind, self.unit, self.dtype, self.shape, read_values)

    def _values(self, read: ReadNumbers, start: int, stop: int) -> Values:
        numbers = read(start, stop).astype(self.dtype, copy=False)
        return np.ascontiguousarray(numbers.reshape(-1, *self.shape[1:]))


def named_tracks(
    candidates: Iterable[Candidate],
    n_frames: int,
    n_verts: int,
    description: Description,
    notes: Notes,
) -> dict[str, NamedTrack]:
    """Return the tracks among the candidates by name; a note lists the others and what is needed.

    Raises
    ------
    InvalidInputError
        If two tracks share a name.
    """
    sizes = domain_sizes(n_verts, len(description.faces), description.surface)
    tracks: dict[str, NamedTrack] = {}
    other_paths = []
    for candidate in candidates:
        track = _track(candidate, n_frames, sizes)
        if track is None:
            other_paths.append(candidate.path)
        elif candidate.name in tracks:
            raise InvalidInputError(
                f"contains the track {candidate.name!r} twice, as {tracks[candidate.name].path!r} "
                f"and {candidate.path!r}; rename one of them"
            )
        else:
            tracks[candidate.name] = track
    if other_paths:
        text = (
            f"left out: arrays: {listed(other_paths)}; tracks are numbers of shape ({n_frames}, N) "
            f"or ({n_frames}, N, C), C up to {MAX_COLUMNS}, for {describe_sizes(sizes)}"
        )
        notes.append(Note(NoteKind.LEFT_OUT, "arrays", other_paths, text))
    return tracks


def array_names(names: Iterable[str]) -> dict[str, str]:
    """Return a valid and unique array name for each track; deterministic."""
    arrays: dict[str, str] = {}
    used: set[str] = set()
    for name in names:
        array = array_name(name)
        while array in used:
            array += "_"
        used.add(array)
        arrays[name] = array
    return arrays


def array_name(name: str) -> str:
    """Return a name without the characters that have a meaning in archives and HDF5 paths."""
    name = name.encode("utf-8", "replace").decode().replace("/", "_").replace("\0", "_")
    return name.strip(".") or "unnamed"


def _track(candidate: Candidate, n_frames: int, sizes: Mapping[Domain, int]) -> NamedTrack | None:
    """Return the track of an array; None if its shape or type is unsuitable."""
    native = candidate.dtype.newbyteorder("=")
    dtype = WIDENED_TYPES.get(native, native)
    is_wide = len(candidate.shape) == 3
    if dtype not in NUMBER_TYPES or not (is_wide or len(candidate.shape) == 2):
        return None
    n_columns = candidate.shape[2] if is_wide else 1
    domains = [domain for domain, size in sizes.items() if size == candidate.shape[1]]
    if candidate.domain:
        domains = [domain for domain in domains if domain == candidate.domain]
    if candidate.shape[0] != n_frames or not domains or not 1 <= n_columns <= MAX_COLUMNS:
        return None
    shape = n_frames, candidate.shape[1], n_columns
    kind = parse_track_kind(candidate.kind, n_columns, dtype) or default_kind(n_columns)
    return NamedTrack(candidate.path, domains[0], kind, candidate.unit, dtype, shape)
