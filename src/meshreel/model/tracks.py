"""Track: a quantity that changes over time, on the vertices, faces or corners of a mesh."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted

AnyTrack = TypeVar("AnyTrack")

NUMBER_TYPES = tuple(
    np.dtype(name) for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
)
"""Number types of values."""

MAX_COLUMNS = 256
"""Most numbers of a value."""

BLOCK_BYTES = 1 << 24
"""Bytes of values that are read together."""


class TrackKind(StrEnum):
    """Meaning of a track."""

    SCALAR = "scalar"
    VECTOR = "vector"
    VELOCITY = "velocity"
    NORMAL = "normal"
    COLOR = "color"
    UV = "uv"
    OTHER = "other"


COLUMNS_OF: Mapping[TrackKind, tuple[int, ...]] = {
    TrackKind.SCALAR: (1,),
    TrackKind.VECTOR: (2, 3),
    TrackKind.VELOCITY: (3,),
    TrackKind.NORMAL: (3,),
    TrackKind.COLOR: (3, 4),
    TrackKind.UV: (2,),
    TrackKind.OTHER: tuple(range(1, MAX_COLUMNS + 1)),
}
"""Numbers that a value of a kind may have."""


class TrackSource(Protocol):
    """A track whose values are read on demand; a `Track` is one."""

    @property
    def domain(self) -> Domain:
        """Where its values are."""

    @property
    def kind(self) -> TrackKind:
        """What it means."""

    @property
    def unit(self) -> str:
        """The unit of its numbers, or nothing."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type, one of `NUMBER_TYPES`."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, vertices or faces or corners, and numbers of each value: (T, N, C)."""

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, N, C)."""


class Track:
    """A quantity over time.

    Its length is the number of frames; ``track[3]`` is the values of a frame, of shape (N, C).

    Parameters
    ----------
    values : array of shape (T, N) or (T, N, C)
        Integers of 8 to 64 bits, float32 or float64; booleans become uint8. C is 1..256. Kept as a
        read-only view of shape (T, N, C). NaN is a missing value.
    domain : {"vertex", "face", "corner"} or Domain, default "vertex"
        Where the values are; faces are polygons, corners are theirs.
    kind : str or TrackKind, optional
        "scalar", "vector" (2 or 3 numbers), "velocity" (3; model units a second), "normal" (3; of
        length 1), "color" (3 or 4; of 0..1 if they are floats), "uv" (2) or "other". Default:
        "scalar" for one number, "vector" for two or three, else "other".
    unit : str, default ""
        Of the numbers, such as "Pa".

    Attributes
    ----------
    values, domain, kind, unit
        As given.

    Raises
    ------
    InvalidInputError
        If shape or type are not allowed, or not for the kind.
    """

    def __init__(
        self,
        values: npt.ArrayLike,
        domain: str | Domain = Domain.VERTEX,
        kind: str | TrackKind | None = None,
        unit: str = "",
    ) -> None:
        self.values = _checked_values(values)
        self.domain: Domain = _named(Domain, "domain", domain)
        self.kind: TrackKind = _named(TrackKind, "kind", kind or default_kind(self.values.shape[2]))
        self.unit = unit
        check_kind(self.kind, self.shape[2], self.dtype)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type."""
        return self.values.dtype

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, vertices or faces or corners, and numbers of each value: (T, N, C)."""
        n_frames, n_items, n_columns = self.values.shape
        return n_frames, n_items, n_columns

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, N, C)."""
        return self.values[start:stop]

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, chosen: Any) -> Values:
        """Values of a frame, of shape (N, C), or of several, of shape (T, N, C)."""
        chosen_values: Values = self.values[chosen]
        return chosen_values

    def __iter__(self) -> Iterator[Values]:
        return iter(self.values)

    def __repr__(self) -> str:
        return f"<Track: {described_track(self)}, {counted(len(self), 'frame')}>"


@dataclass(frozen=True, eq=False)
class DerivedTrack:
    """What a track read from another one has of it: all but the shape and the values."""

    whole: TrackSource

    @property
    def domain(self) -> Domain:
        """Where its values are."""
        return self.whole.domain

    @property
    def kind(self) -> TrackKind:
        """What it means."""
        return self.whole.kind

    @property
    def unit(self) -> str:
        """The unit of its numbers, or nothing."""
        return self.whole.unit

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type."""
        return self.whole.dtype


@dataclass(frozen=True, eq=False)
class TrackPart(DerivedTrack):
    """Some frames of a track, read on demand.

    Parameters
    ----------
    whole : TrackSource
    frames : range
        Numbers of its frames, one after the other.
    """

    frames: range

    @property
    def shape(self) -> tuple[int, int, int]:
        """Frames, vertices or faces or corners, and numbers of each value: (T, N, C)."""
        return (len(self.frames), *self.whole.shape[1:])

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1 of the part, of shape (stop - start, N, C)."""
        first = self.frames.start
        return self.whole.read(first + start, first + stop)


def described_track(track: TrackSource) -> str:
    """A track in words, such as "scalar of each vertex, float32 in Pa"."""
    n_columns = track.shape[2]
    width = f"{n_columns} x " if n_columns > 1 else ""
    unit = f" in {track.unit}" if track.unit else ""
    return f"{track.kind} of each {track.domain}, {width}{track.dtype}{unit}"


def tracks_of(
    tracks: Mapping[str, Any] | None, n_frames: int, n_verts: int, n_faces: int, surface: Surface
) -> dict[str, Track]:
    """Tracks by their names.

    Parameters
    ----------
    tracks : mapping of str to Track, or to values as `Track` takes them; or None
        Values are of the first domain that has as many: vertices, faces, corners.
    n_frames, n_verts, n_faces : int
        Of the sequence; its faces are triangles.
    surface : Surface
        Says how many polygons and corners there are.

    Raises
    ------
    InvalidInputError
        Naming the track whose values, or number of frames or places, do not fit.
    """
    found: dict[str, Track] = {}
    sizes = domain_sizes(n_verts, n_faces, surface)
    for name, given in dict(tracks or {}).items():
        if not isinstance(name, str) or not name:
            raise InvalidInputError(f"a track needs a name of its own; got {name!r}")
        try:
            is_track = isinstance(given, Track)
            track = given if is_track else Track(given, _fitting_domain(given, sizes))
        except InvalidInputError as error:
            raise InvalidInputError(f"track {name!r}: {error}") from None
        _check_size(name, track, n_frames, sizes)
        found[name] = track
    return found


def named_track(tracks: Mapping[str, AnyTrack], name: str) -> AnyTrack:
    """The track of a name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    if name in tracks:
        return tracks[name]
    near = get_close_matches(name, tracks, 1)
    there = f"there are {', '.join(tracks)}" if tracks else "there are no tracks"
    advice = f"did you mean {near[0]!r}?" if near else there
    raise InvalidInputError(f"there is no track {name!r}; {advice}")


def copied(track: TrackSource, frames: range) -> Track:
    """Some frames of a track, in memory.

    Raises
    ------
    InvalidInputError
        If the values do not fit the kind.
    """
    values = track.read(frames.start, frames.stop)
    return Track(values, track.domain, track.kind, track.unit)


def joined(frames: Sequence[Mapping[str, Track]]) -> dict[str, Track]:
    """Tracks of frames one after another, which all have the same ones."""
    return {
        name: Track(
            np.concatenate([frame[name].values for frame in frames]),
            first.domain,
            first.kind,
            first.unit,
        )
        for name, first in frames[0].items()
    }


def copied_together(tracks: Mapping[str, TrackSource]) -> dict[str, Track]:
    """All frames of tracks, in memory; those of a frame are read one after the other.

    Raises
    ------
    InvalidInputError
        If the values of a track do not fit its kind.
    """
    values = {name: np.empty(track.shape, track.dtype) for name, track in tracks.items()}
    for frame in range(max((track.shape[0] for track in tracks.values()), default=0)):
        for name, track in tracks.items():
            values[name][frame : frame + 1] = track.read(frame, frame + 1)
    return {
        name: Track(values[name], track.domain, track.kind, track.unit)
        for name, track in tracks.items()
    }


def size_bytes(track: TrackSource) -> int:
    """Size of all values of a track in memory."""
    return math.prod(track.shape) * track.dtype.itemsize


def check_tracks(
    tracks: Mapping[str, TrackSource], n_frames: int, n_verts: int, n_faces: int, surface: Surface
) -> None:
    """Nothing if tracks fit a sequence; the parameters and errors are those of `tracks_of`."""
    sizes = domain_sizes(n_verts, n_faces, surface)
    for name, track in tracks.items():
        _check_size(name, track, n_frames, sizes)


def domain_sizes(n_verts: int, n_faces: int, surface: Surface) -> dict[Domain, int]:
    """Number of vertices, polygons and corners of polygons."""
    return {domain: surface.n_items(domain, n_verts, n_faces) for domain in Domain}


def track_blocks(track: TrackSource) -> Iterator[tuple[int, Values]]:
    """All values of a track, some frames at a time, with the number of the first of them."""
    n_frames, n_items, n_columns = track.shape
    n_together = max(1, BLOCK_BYTES // (n_items * n_columns * track.dtype.itemsize))
    for start in range(0, n_frames, n_together):
        yield start, track.read(start, min(start + n_together, n_frames))


def value_range(track: TrackSource, n_together: int = 64) -> tuple[Values, Values]:
    """Lowest and highest finite number of each column, of shape (C,); NaN where there is none."""
    n_frames, _, n_columns = track.shape
    low, high = np.full(n_columns, np.nan), np.full(n_columns, np.nan)
    for start in range(0, n_frames, n_together):
        values = track.read(start, min(start + n_together, n_frames)).astype(np.float64, copy=False)
        is_finite = np.isfinite(values)
        axes = (0, 1)
        low = np.fmin(low, _or_nan(np.min(values, axes, where=is_finite, initial=np.inf)))
        high = np.fmax(high, _or_nan(np.max(values, axes, where=is_finite, initial=-np.inf)))
    return low, high


def _or_nan(values: Values) -> Values:
    return np.where(np.isfinite(values), values, np.nan)


def _check_size(name: str, track: TrackSource, n_frames: int, sizes: Mapping[Domain, int]) -> None:
    found_frames, n_items, _ = track.shape
    if found_frames != n_frames:
        raise InvalidInputError(
            f"track {name!r} has {counted(found_frames, 'frame')}; the positions have {n_frames}"
        )
    if sizes[track.domain] != n_items:
        raise InvalidInputError(
            f"track {name!r} has {counted(n_items, 'value')} of each frame, said to be of each "
            f"{track.domain}; the mesh has {described_sizes(sizes)}"
        )


def _fitting_domain(values: Any, sizes: Mapping[Domain, int]) -> Domain:
    """The first domain of as many places as values have."""
    shape = np.shape(values)
    n_items = shape[1] if len(shape) > 1 else None
    for domain, size in sizes.items():
        if size == n_items:
            return domain
    raise InvalidInputError(
        f"values of shape {shape} are not of vertices, faces or corners: the mesh has "
        f"{described_sizes(sizes)}"
    )


def described_sizes(sizes: Mapping[Domain, int]) -> str:
    """Numbers of vertices, faces and corners in words."""
    vertices, faces, corners = (sizes[domain] for domain in Domain)
    return (
        f"{counted(vertices, 'vertex')}, {counted(faces, 'face')} and {counted(corners, 'corner')}"
    )


def _checked_values(given: Any) -> Values:
    values = np.asarray(given)
    if values.dtype == np.bool_:
        values = values.view(np.uint8)
    if values.ndim == 2:
        values = values[:, :, None]
    if values.ndim != 3 or 0 in values.shape:
        raise InvalidInputError(
            f"values must have shape (T, N) or (T, N, C), none of them 0; got {np.shape(given)}"
        )
    if values.dtype.newbyteorder("=") not in NUMBER_TYPES:
        allowed = ", ".join(map(str, NUMBER_TYPES))
        raise InvalidInputError(f"values must be bool, {allowed}; got {values.dtype}")
    values = np.ascontiguousarray(values, values.dtype.newbyteorder("="))
    if values.shape[2] > MAX_COLUMNS:
        raise InvalidInputError(
            f"a value may have {MAX_COLUMNS} numbers; got {values.shape[2]}: make several tracks "
            "of it"
        )
    values = values.view()
    values.flags.writeable = False
    return values


def default_kind(n_columns: int) -> TrackKind:
    """The kind of values of so many numbers of which nothing else is known."""
    if n_columns == 1:
        return TrackKind.SCALAR
    return TrackKind.VECTOR if n_columns in COLUMNS_OF[TrackKind.VECTOR] else TrackKind.OTHER


def _named(choices: type[StrEnum], what: str, given: str) -> Any:
    try:
        return choices(given)
    except ValueError:
        allowed = ", ".join(choices)
        raise InvalidInputError(f"{what} is one of {allowed}; got {given!r}") from None


def check_kind(kind: TrackKind, n_columns: int, dtype: np.dtype[Any]) -> None:
    """Nothing if values of a kind may have so many numbers of a type.

    Raises
    ------
    InvalidInputError
        If they have another number of columns, or must be floats.
    """
    allowed = COLUMNS_OF[kind]
    if n_columns not in allowed:
        several = " or ".join(map(str, allowed))
        raise InvalidInputError(
            f"values of the kind {kind} have {counted(allowed[0], 'number')}"
            + (f" ({several})" if len(allowed) > 1 else "")
            + f"; got {n_columns}"
        )
    needs_floats = kind in (TrackKind.NORMAL, TrackKind.VELOCITY, TrackKind.UV)
    if needs_floats and dtype.kind != "f":
        raise InvalidInputError(
            f"values of the kind {kind} must be float32 or float64; got {dtype}"
        )
