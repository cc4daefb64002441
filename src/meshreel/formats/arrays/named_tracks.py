"""Arrays of a file that are tracks of its sequence, the same in NumPy archives and in HDF5 files.

They are those beside the positions of shape (T, N) or (T, N, C) for T frames and N vertices, faces
or corners, and those in the folder ``tracks`` beside them. What a file says of one beside its
numbers, domain, kind and unit, counts; else its size does.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.array_frames import Description
from meshreel.formats.frames.stored_tracks import StoredTrack, kind_said
from meshreel.formats.notes import listed, note_left_out
from meshreel.model.surface import Domain
from meshreel.model.tracks import (
    MAX_COLUMNS,
    NUMBER_TYPES,
    Track,
    TrackKind,
    TrackSource,
    default_kind,
    described_sizes,
    domain_sizes,
)

FOLDER = "tracks"
"""Where tracks are written to, beside the positions."""

READ_AS: dict[np.dtype[Any], np.dtype[Any]] = {
    np.dtype(np.bool_): np.dtype(np.uint8),
    np.dtype(np.float16): np.dtype(np.float32),
}
"""Types of files that tracks do not have, and those that hold the same numbers."""

ReadNumbers = Callable[[int, int], npt.NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Candidate:
    """An array of a file that may be a track.

    Parameters
    ----------
    place : str
        Where it is in the file.
    name : str
        Of the track that it may be.
    dtype : dtype
        As in the file, in whatever byte order.
    domain, kind, unit : str, default ""
        What the file says of it.
    """

    place: str
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    domain: str = ""
    kind: str = ""
    unit: str = ""


@dataclass(frozen=True, eq=False)
class NamedTrack:
    """An array of a file that is a track.

    Attributes
    ----------
    name, place : str
        Of the track, and where its array is in the file.
    dtype : dtype
        Of the track.
    shape : tuple of int
        (T, N, C).
    """

    name: str
    place: str
    domain: Domain
    kind: TrackKind
    unit: str
    dtype: np.dtype[Any]
    shape: tuple[int, int, int]

    @property
    def size_bytes(self) -> int:
        """Size of all its values."""
        return int(np.prod(self.shape, dtype=np.int64)) * self.dtype.itemsize

    def values(self, array: npt.NDArray[Any]) -> Values:
        """Numbers of the file, of some frames or all, as values of shape (T, N, C)."""
        found = array.astype(self.dtype, copy=False)
        return np.ascontiguousarray(found.reshape(len(array), *self.shape[1:]))

    def loaded(self, array: npt.NDArray[Any]) -> Track:
        """The track of an array that was read."""
        return Track(self.values(array), self.domain, self.kind, self.unit)

    def stored(self, read: ReadNumbers) -> TrackSource:
        """The track of an array that stays in its file.

        Parameters
        ----------
        read : function of a start and a stop
            Gives the numbers of frames start..stop - 1 as they are in the file.
        """
        read_values = _ReadValues(self, read)
        return StoredTrack(self.domain, self.kind, self.unit, self.dtype, self.shape, read_values)


@dataclass(frozen=True, eq=False)
class _ReadValues:
    """Values of frames, made of the numbers of a file; can be sent to another process."""

    track: NamedTrack
    read: ReadNumbers

    def __call__(self, start: int, stop: int) -> Values:
        return self.track.values(self.read(start, stop))


def named_tracks(
    candidates: Iterable[Candidate],
    n_frames: int,
    n_verts: int,
    about: Description,
    notes: list[str],
) -> dict[str, NamedTrack]:
    """The tracks among arrays, by their names; the notes say what would make the others fit.

    Raises
    ------
    InvalidInputError
        If two of them have one name.
    """
    sizes = domain_sizes(n_verts, len(about.faces), about.surface)
    found: dict[str, NamedTrack] = {}
    others = []
    for one in candidates:
        track = _track(one, n_frames, sizes)
        if track is None:
            others.append(one.place)
        elif one.name in found:
            raise InvalidInputError(
                f"holds the track {one.name!r} twice, as {found[one.name].place!r} and "
                f"{one.place!r}; rename one of the two"
            )
        else:
            found[one.name] = track
    if others:
        note_left_out(
            notes,
            f"arrays: {listed(others)}; tracks are numbers of shape ({n_frames}, N) or "
            f"({n_frames}, N, C), C up to {MAX_COLUMNS}, for {described_sizes(sizes)}",
        )
    return found


def array_names(names: Iterable[str]) -> dict[str, str]:
    """A name for the array of each track in its file, where some characters mean something.

    No two are alike; the same names give the same ones.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        array = array_name(name)
        while array in taken:
            array += "_"
        taken.add(array)
        found[name] = array
    return found


def array_name(name: str) -> str:
    """A name for an array in a file, where some characters mean something."""
    name = name.encode("utf-8", "replace").decode().replace("/", "_").replace("\0", "_")
    return name.strip(".") or "unnamed"


def _track(one: Candidate, n_frames: int, sizes: Mapping[Domain, int]) -> NamedTrack | None:
    """The track that an array is; None if its shape or type are not of one."""
    native = one.dtype.newbyteorder("=")
    dtype = READ_AS.get(native, native)
    is_wide = len(one.shape) == 3
    if dtype not in NUMBER_TYPES or not (is_wide or len(one.shape) == 2):
        return None
    n_columns = one.shape[2] if is_wide else 1
    domains = [domain for domain, size in sizes.items() if size == one.shape[1]]
    if one.domain:
        domains = [domain for domain in domains if domain == one.domain]
    if one.shape[0] != n_frames or not domains or not 1 <= n_columns <= MAX_COLUMNS:
        return None
    shape = n_frames, one.shape[1], n_columns
    kind = kind_said(one.kind, n_columns, dtype) or default_kind(n_columns)
    return NamedTrack(one.name, one.place, domains[0], kind, one.unit, dtype, shape)
