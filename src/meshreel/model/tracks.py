"""Track: a quantity that changes over time, on the vertices, faces or corners of a mesh."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum, StrEnum
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError, MissingTrackError
from meshreel.model.surface import Domain, Surface
from meshreel.model.validation import frozen, hand_over, restore
from meshreel.runtime.counting import counted

AnyTrack = TypeVar("AnyTrack")

NUMBER_TYPES = tuple(
    np.dtype(name) for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
)
MAX_COLUMNS = 256
"""Maximum number of components of a value."""

FACE_MASKS = ("scanned", "alive")
"""Names of tracks of faces, one number each: pictures and players hide the faces where it is 0."""

BLOCK_BYTES = 1 << 24
"""Size of the values that `track_blocks` reads at once."""


class TrackKind(StrEnum):
    """Meaning of a track."""

    SCALAR = "scalar"
    VECTOR = "vector"
    VELOCITY = "velocity"
    NORMAL = "normal"
    COLOR = "color"
    UV = "uv"
    OTHER = "other"


class ErrorMeasure(Enum):
    """What the error of a value is."""

    LENGTH = "length of the difference"
    NUMBER = "largest difference of a number"
    ANGLE = "angle between directions, in degrees"


@dataclass(frozen=True)
class KindRow:
    """What distinguishes the tracks of a kind."""

    code: int
    """Number in a stream."""
    columns: tuple[int, ...]
    """Allowed numbers of components."""
    needs_floats: bool = False
    has_unit: bool = False
    """Whether values are a physical quantity, which can be interpolated over time."""
    error: ErrorMeasure = ErrorMeasure.LENGTH
    default_bound: str = "0.1%"
    """Default error bound of floats if the target is an error of positions."""
    visible_ratio: float = 2.0
    """Bound at the default quality, relative to `default_bound`; 0.2 % is half a level of 256."""
    follows: str = ""
    """Quantity of the moving surface that predicts values: "normals", or "motion" of vertices."""
    component: str = "magnitude"
    """Component of several that is shown by default; "color" shows all directly."""
    range: str = "2%:98%"
    """Default color range."""

    @property
    def is_direction(self) -> bool:
        """Whether values have length 1, or 0 if missing; their error is an angle."""
        return self.error is ErrorMeasure.ANGLE


KIND_ROWS: Mapping[TrackKind, KindRow] = {
    TrackKind.SCALAR: KindRow(6, (1,), has_unit=True),
    TrackKind.VECTOR: KindRow(1, (2, 3), has_unit=True),
    # 1 %; errors of positions per frame interval are 1.2 % to 5 % of the range.
    TrackKind.VELOCITY: KindRow(
        2, (3,), needs_floats=True, has_unit=True, visible_ratio=10.0, follows="motion"
    ),
    TrackKind.NORMAL: KindRow(
        3,
        (3,),
        needs_floats=True,
        error=ErrorMeasure.ANGLE,
        default_bound="0.5deg",
        follows="normals",
        component="x",
        range="-1:1",
    ),
    TrackKind.COLOR: KindRow(
        4,
        (3, 4),
        error=ErrorMeasure.NUMBER,
        default_bound="8bit",
        visible_ratio=1.0,
        component="color",
    ),
    # Half a texel of a 4096 texture.
    TrackKind.UV: KindRow(
        5, (2,), needs_floats=True, default_bound=str(0.5 / 4096), visible_ratio=1.0
    ),
    TrackKind.OTHER: KindRow(0, tuple(range(1, MAX_COLUMNS + 1)), has_unit=True),
}


class TrackSource(Protocol):
    """A track whose values are read on demand; a `Track` is one."""

    @property
    def domain(self) -> Domain:
        """Elements that have values."""

    @property
    def kind(self) -> TrackKind:
        """Meaning of the values."""

    @property
    def unit(self) -> str:
        """Unit of the values, possibly empty."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type, one of `NUMBER_TYPES`."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of frames, of elements, and of components of each value: (T, N, C)."""

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, N, C)."""


@dataclass(frozen=True, eq=False)
class Track:
    """A quantity over time; it does not change.

    Its length is the number of frames; ``track[3]`` returns the values of a frame, of shape (N, C).

    Parameters
    ----------
    values : array of shape (T, N) or (T, N, C)
        Integers of 8 to 64 bits, float32 or float64; booleans become uint8. C is 1..256. Stored
        read-only in shape (T, N, C), as a copy unless the array is read-only. NaN marks missing
        values.
    domain : {"vertex", "face", "corner", "cell"} or Domain, default "vertex"
        Elements that have values; faces are polygons, with their corners.
    kind : str or TrackKind, optional
        "scalar", "vector" (2 or 3 components), "velocity" (3; model units per second), "normal" (3;
        unit length), "color" (3 or 4; as in `Attribute`), "uv" (2) or "other". Default: "scalar"
        for one component, "vector" for two or three, else "other".
    unit : str, default ""
        Unit of the values, such as "Pa".
    error_bound : float or None, default 0
        Guaranteed largest error of a value relative to the original, as of a `ReelTrack`: 0 for the
        original, None if unknown.

    Raises
    ------
    InvalidInputError
        If the shape or type is not allowed, or not allowed for the kind.
    """

    values: Values
    domain: Domain
    kind: TrackKind
    unit: str
    error_bound: float | None
    __setstate__ = restore

    def __init__(
        self,
        values: npt.ArrayLike,
        domain: str | Domain = Domain.VERTEX,
        kind: str | TrackKind | None = None,
        unit: str = "",
        error_bound: float | None = 0.0,
    ) -> None:
        values = _validated_values(values)
        kind = _member(TrackKind, "kind", kind or default_kind(values.shape[2]))
        domain = _member(Domain, "domain", domain)
        vars(self).update(
            values=values, domain=domain, kind=kind, unit=unit, error_bound=error_bound
        )
        check_kind(self.kind, self.shape[2], self.dtype)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type."""
        return self.values.dtype

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of frames, of elements, and of components of each value: (T, N, C)."""
        n_frames, n_items, n_columns = self.values.shape
        return n_frames, n_items, n_columns

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1, of shape (stop - start, N, C)."""
        return self.values[start:stop]

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, choice: Any) -> Values:
        """Values of a frame, of shape (N, C), or of several frames, of shape (T, N, C)."""
        values: Values = self.values[choice]
        return values

    def __iter__(self) -> Iterator[Values]:
        return iter(self.values)

    def __repr__(self) -> str:
        return f"<Track: {describe_track(self)}, {counted(len(self), 'frame')}>"


@dataclass(frozen=True, eq=False)
class DerivedTrack:
    """A track derived from another one, with the same domain, kind, unit and number type."""

    whole: TrackSource

    @property
    def domain(self) -> Domain:
        """Elements that have values."""
        return self.whole.domain

    @property
    def kind(self) -> TrackKind:
        """Meaning of the values."""
        return self.whole.kind

    @property
    def unit(self) -> str:
        """Unit of the values, possibly empty."""
        return self.whole.unit

    @property
    def dtype(self) -> np.dtype[Any]:
        """Number type."""
        return self.whole.dtype

    @property
    def error_bound(self) -> float | None:
        """As of a `Track`."""
        return error_bound_of(self.whole)


@dataclass(frozen=True, eq=False)
class TrackPart(DerivedTrack):
    """Consecutive frames of a track, read on demand.

    Parameters
    ----------
    frames : range
        Consecutive frame numbers.
    """

    frames: range

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of frames, of elements, and of components of each value: (T, N, C)."""
        return (len(self.frames), *self.whole.shape[1:])

    def read(self, start: int, stop: int) -> Values:
        """Values of frames start..stop - 1 of the part, of shape (stop - start, N, C)."""
        first = self.frames.start
        return self.whole.read(first + start, first + stop)


def error_bound_of(*sources: Any) -> float | None:
    """Return the largest error bound of frames or tracks: 0 for originals, None if one is unknown.

    Sources of users have no attribute `error_bound`; they are originals.
    """
    bounds = [getattr(source, "error_bound", 0.0) for source in sources]
    return None if None in bounds else max(bounds)


def error_unit(kind: TrackKind, unit: str) -> str:
    """Return the unit of the errors of a track: its own, or "deg" for directions."""
    return "deg" if KIND_ROWS[kind].is_direction else unit


def is_color(kind: str, dtype: np.dtype[Any]) -> bool:
    """Whether values are colors of a type that most files support: floats or bytes."""
    return kind == TrackKind.COLOR and (dtype.kind == "f" or dtype == np.uint8)


def describe_track(track: TrackSource) -> str:
    """Text about a track, such as "scalar of each vertex, float32 in Pa"."""
    return describe_values(track.kind, track.domain, track.shape[2], str(track.dtype), track.unit)


def describe_values(kind: str, domain: str, n_columns: int, number_type: str, unit: str) -> str:
    """Text about the values of a track, as `describe_track`."""
    width = f"{n_columns} x " if n_columns > 1 else ""
    return f"{kind} of each {domain}, {width}{number_type}" + (f" in {unit}" if unit else "")


def validated_tracks(
    tracks: Mapping[str, Any] | None, n_frames: int, n_verts: int, n_faces: int, surface: Surface
) -> dict[str, Track]:
    """Return tracks that fit a sequence, by name.

    Parameters
    ----------
    tracks : mapping of str to Track, or to values of a Track; or None
        Values belong to the first domain of the same size: vertices, faces, corners.
    n_frames, n_verts, n_faces : int
        Counts of the sequence; its faces are triangles.
    surface : Surface
        Determines the number of polygons and corners.

    Raises
    ------
    InvalidInputError
        If values, or the number of frames or elements, do not fit; the message names the track.
    """
    validated: dict[str, Track] = {}
    sizes = domain_sizes(n_verts, n_faces, surface)
    for name, values in dict(tracks or {}).items():
        if not isinstance(name, str) or not name:
            raise InvalidInputError(f"a track needs a non-empty name; got {name!r}")
        try:
            is_track = isinstance(values, Track)
            track = values if is_track else Track(values, _fitting_domain(values, sizes))
        except InvalidInputError as error:
            raise InvalidInputError(f"track {name!r}: {error}") from None
        _check_size(name, track, n_frames, sizes)
        validated[name] = track
    return validated


def track_by_name(tracks: Mapping[str, AnyTrack], name: str) -> AnyTrack:
    """Return the track with a name.

    Raises
    ------
    MissingTrackError
        If there is none, a KeyError; the message suggests or lists names.
    """
    if name in tracks:
        return tracks[name]
    close = get_close_matches(name, tracks, 1)
    existing = f"there are {', '.join(tracks)}" if tracks else "there are no tracks"
    advice = f"did you mean {close[0]!r}?" if close else existing
    raise MissingTrackError(f"there is no track {name!r}; {advice}")


def max_items(n_verts: int, tracks: Iterable[TrackSource]) -> int:
    """Return the number of vertices, or of vectors of three in a frame of the largest track."""
    return max(n_verts, *(track.shape[1] * max(3, track.shape[2]) // 3 for track in tracks), 0)


def track_like(track: TrackSource, values: Values) -> Track:
    """Return a track with the domain, kind, unit and error bound of another one.

    Raises
    ------
    InvalidInputError
        If the values do not fit the kind.
    """
    return Track(values, track.domain, track.kind, track.unit, error_bound_of(track))


def concatenate_tracks(frames: Sequence[Mapping[str, Track]]) -> dict[str, Track]:
    """Concatenate tracks over time; all mappings have the same names."""
    joined = {}
    for name, first in frames[0].items():
        tracks = [frame[name] for frame in frames]
        values = hand_over(np.concatenate([track.values for track in tracks]))
        bound = error_bound_of(*tracks)
        joined[name] = Track(values, first.domain, first.kind, first.unit, bound)
    return joined


def read_tracks(tracks: Mapping[str, TrackSource]) -> dict[str, Track]:
    """Read all tracks into memory, frame by frame: files store a frame of all tracks together.

    Raises
    ------
    InvalidInputError
        If the values of a track do not fit its kind.
    """
    values = {name: np.empty(track.shape, track.dtype) for name, track in tracks.items()}
    for frame in range(max((track.shape[0] for track in tracks.values()), default=0)):
        for name, track in tracks.items():
            values[name][frame : frame + 1] = track.read(frame, frame + 1)
    return {name: track_like(track, hand_over(values[name])) for name, track in tracks.items()}


def size_bytes(track: TrackSource) -> int:
    """Size of all values of a track in memory."""
    return math.prod(track.shape) * track.dtype.itemsize


def check_tracks(
    tracks: Mapping[str, TrackSource], n_frames: int, n_verts: int, n_faces: int, surface: Surface
) -> None:
    """Check that tracks fit a sequence; parameters and errors as in `validated_tracks`."""
    sizes = domain_sizes(n_verts, n_faces, surface)
    for name, track in tracks.items():
        _check_size(name, track, n_frames, sizes)


def domain_sizes(n_verts: int, n_faces: int, surface: Surface) -> dict[Domain, int]:
    """Numbers of vertices, cells, polygons and corners of polygons."""
    order = Domain.VERTEX, Domain.CELL, Domain.FACE, Domain.CORNER
    return {domain: surface.n_items(domain, n_verts, n_faces) for domain in order}


def track_blocks(track: TrackSource) -> Iterator[tuple[int, Values]]:
    """Yield the first frame number and values of blocks of a track, in order."""
    n_frames, n_items, n_columns = track.shape
    block_frames = max(1, BLOCK_BYTES // (n_items * n_columns * track.dtype.itemsize))
    for start in range(0, n_frames, block_frames):
        yield start, track.read(start, min(start + block_frames, n_frames))


def value_range(track: TrackSource, block_frames: int = 64) -> tuple[Values, Values]:
    """Minimum and maximum finite value of each column, of shape (C,); NaN if there is none."""
    n_frames, _, n_columns = track.shape
    low, high = np.full(n_columns, np.nan), np.full(n_columns, np.nan)
    for start in range(0, n_frames, block_frames):
        values = track.read(start, min(start + block_frames, n_frames))
        values = values.astype(np.float64, copy=False)
        is_finite = np.isfinite(values)
        axes = (0, 1)
        low = np.fmin(low, _or_nan(np.min(values, axes, where=is_finite, initial=np.inf)))
        high = np.fmax(high, _or_nan(np.max(values, axes, where=is_finite, initial=-np.inf)))
    return low, high


def _or_nan(values: Values) -> Values:
    return np.where(np.isfinite(values), values, np.nan)


def _check_size(name: str, track: TrackSource, n_frames: int, sizes: Mapping[Domain, int]) -> None:
    n_track_frames, n_items, _ = track.shape
    if n_track_frames != n_frames:
        raise InvalidInputError(
            f"track {name!r} has {counted(n_track_frames, 'frame')}; the positions have {n_frames}"
        )
    if sizes[track.domain] != n_items:
        raise InvalidInputError(
            f"track {name!r} has {counted(n_items, 'value')} per frame for domain {track.domain}; "
            f"the mesh has {describe_sizes(sizes)}"
        )


def _fitting_domain(values: Any, sizes: Mapping[Domain, int]) -> Domain:
    """The first domain whose size is that of the values."""
    shape = np.shape(values)
    n_items = shape[1] if len(shape) > 1 else None
    for domain, size in sizes.items():
        if size == n_items:
            return domain
    raise InvalidInputError(
        f"values of shape {shape} do not fit vertices, faces, corners or cells: the mesh has "
        f"{describe_sizes(sizes)}"
    )


def describe_sizes(sizes: Mapping[Domain, int]) -> str:
    """Text with the numbers of vertices, faces, corners, and cells if there are some."""
    *first, last = [
        counted(sizes[domain], domain)
        for domain in Domain
        if domain is not Domain.CELL or sizes[domain]
    ]
    return f"{', '.join(first)} and {last}"


def _validated_values(array: Any) -> Values:
    values = np.asarray(array)
    if values.dtype == np.bool_:
        values = values.view(np.uint8)
    if values.ndim == 2:
        values = values[:, :, None]
    if values.ndim != 3 or 0 in values.shape:
        raise InvalidInputError(
            f"values must have shape (T, N) or (T, N, C), none of them 0; got {np.shape(array)}"
        )
    if values.dtype.newbyteorder("=") not in NUMBER_TYPES:
        allowed = ", ".join(map(str, NUMBER_TYPES))
        raise InvalidInputError(f"values must be bool, {allowed}; got {values.dtype}")
    values = np.ascontiguousarray(values, values.dtype.newbyteorder("="))
    if values.shape[2] > MAX_COLUMNS:
        raise InvalidInputError(
            f"a value has at most {MAX_COLUMNS} components; got {values.shape[2]}; split the track"
        )
    return frozen(values)


def default_kind(n_columns: int) -> TrackKind:
    """The kind of values with this number of components, if nothing else is known."""
    if n_columns == 1:
        return TrackKind.SCALAR
    return TrackKind.VECTOR if n_columns in KIND_ROWS[TrackKind.VECTOR].columns else TrackKind.OTHER


def _member(choices: type[StrEnum], name: str, value: str) -> Any:
    try:
        return choices(value)
    except ValueError:
        allowed = ", ".join(choices)
        raise InvalidInputError(f"{name} must be one of {allowed}; got {value!r}") from None


def check_kind(kind: TrackKind, n_columns: int, dtype: np.dtype[Any]) -> None:
    """Raise `InvalidInputError` if a kind does not allow this number of columns or number type."""
    allowed = KIND_ROWS[kind].columns
    if n_columns not in allowed:
        counts_text = " or ".join(map(str, allowed))
        raise InvalidInputError(
            f"values of the kind {kind} have {counted(allowed[0], 'number')}"
            + (f" ({counts_text})" if len(allowed) > 1 else "")
            + f"; got {n_columns}"
        )
    if KIND_ROWS[kind].needs_floats and dtype.kind != "f":
        raise InvalidInputError(
            f"values of the kind {kind} must be float32 or float64; got {dtype}"
        )
