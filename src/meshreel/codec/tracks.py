"""Headers of tracks, which precede the first block."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from meshreel.codec.bitstream.container import write_text, write_varint
from meshreel.codec.error_bounds import total_bound
from meshreel.codec.surface.codes import DOMAINS
from meshreel.kernel.structures import NUMBER_TYPES
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackKind

KINDS = sorted(TrackKind, key=lambda kind: KIND_ROWS[kind].code)
"""Kinds of tracks in the order of their codes."""


class Sharing(IntEnum):
    """Which corners of faces share their values in all frames."""

    NONE = 0
    VERTICES = 1
    ROWS = 2


class Coding(IntEnum):
    """Coding of the values of a track."""

    MODES = 0
    EXACT = 1
    ROTATIONS = 2
    BACKWARD = 3
    CENTRAL = 4
    FORWARD = 5
    EXACT_BACKWARD = 6
    EXACT_CENTRAL = 7
    EXACT_FORWARD = 8

    @property
    def difference(self) -> "Coding | None":
        """Difference of positions over time that, times a rate, predicts velocities; or None."""
        is_difference = self >= Coding.BACKWARD
        return DIFFERENCES[(self - Coding.BACKWARD) % len(DIFFERENCES)] if is_difference else None

    @property
    def has_rate(self) -> bool:
        """Whether differences of positions over time predict the track."""
        return self.difference is not None

    @property
    def is_predicted(self) -> bool:
        """Whether residuals relative to decoded positions are coded, of velocities or normals."""
        return self is Coding.ROTATIONS or self.has_rate

    @property
    def is_exact(self) -> bool:
        """Whether values are lossless."""
        return self is Coding.EXACT or self >= Coding.EXACT_BACKWARD

    @property
    def as_exact(self) -> "Coding":
        """The lossless coding by the same difference."""
        return Coding(self + len(DIFFERENCES))


WITH_BOUND = 16
"""Added to the code of an exact coding if the encoded values come from a lossy file."""

SINGLE = 32
"""Added to the code of a coding if its numbers are stored in single precision."""

OF_CELLS = 5
"""Code of the domain of cells; it follows the codes of corners that share values."""

DIFFERENCES = Coding.BACKWARD, Coding.CENTRAL, Coding.FORWARD
"""Differences from the previous position, between both neighbors, and to the next position."""

ROTATION_COLUMNS = 2
"""Numbers that rotate a surface normal to the normal of a track."""


@dataclass(frozen=True)
class TrackHeader:
    """Description of a track, and the range of its numbers."""

    name: str
    unit: str
    kind: TrackKind
    domain: Domain
    """Faces are polygons, and corners are corners of polygons."""
    dtype: np.dtype[Any]
    """Number type of the values."""
    scale: float
    """Scale of coded values, above 0."""
    origin: tuple[float, ...]
    """Numbers are scale times coded values plus the origin of their column, which is 0 unless they
    are coded by modes alone.
    """
    coding: Coding = Coding.MODES
    """Exact codings ignore scale and origin."""
    bound: float = 0.0
    """Guaranteed largest error of a value: in units of the track, in degrees for normals, of each
    number for colors. 0: not guaranteed.
    """
    rate: float = 0.0
    """Frames per unit of time of velocities that are predicted from positions."""
    sharing: Sharing = Sharing.NONE
    """Whether each corner has a separate value, or corners share the value of a vertex or a row."""
    rows: bytes = b""
    """The rows, as encoded by `write_corner_rows`."""
    earlier: float = 0.0
    """Error bound of the encoded values relative to the original, in the measure of `bound`."""

    @property
    def stored_domain(self) -> Domain:
        """Domain of the stored values; shared rows count as corners."""
        return Domain.VERTEX if self.sharing is Sharing.VERTICES else self.domain

    @property
    def is_exact(self) -> bool:
        """Whether its numbers are lossless."""
        return self.coding.is_exact

    @property
    def n_columns(self) -> int:
        """Number of columns, C."""
        return len(self.origin)

    @property
    def n_coded(self) -> int:
        """Number of coded columns."""
        return ROTATION_COLUMNS if self.coding is Coding.ROTATIONS else self.n_columns

    @property
    def placement(self) -> tuple[float, ...]:
        """Scale, and origin of each coded column."""
        return self.scale, *self.origin[: self.n_coded]

    @property
    def total_bound(self) -> float:
        """Guaranteed largest error relative to the original; 0 guarantees nothing, unless exact."""
        return total_bound(self.bound, self.earlier) if self.bound or self.is_exact else 0.0


def write_track(track: TrackHeader) -> bytes:
    """Encode the section TRACK."""
    [number_type] = (code for code, dtype in NUMBER_TYPES.items() if dtype == track.dtype)
    kind, domain = KIND_ROWS[track.kind].code, DOMAINS.index(track.domain) + track.sharing
    domain = OF_CELLS if track.domain is Domain.CELL else domain
    bound = track.total_bound
    coding = track.coding + (WITH_BOUND if track.is_exact and bound else 0)
    numbers: tuple[float, ...] = () if track.is_exact and not bound else (bound,)
    if track.coding is Coding.MODES:
        numbers += track.placement
    elif not track.is_exact:
        numbers += (track.scale,)
    if track.coding.has_rate:
        numbers += (track.rate,)
    stored = np.array(numbers, "<f8")
    with np.errstate(over="ignore", under="ignore"):
        single = stored.astype("<f4")
    if numbers and np.array_equal(single, stored):
        stored, coding = single, coding + SINGLE
    payload = bytes((kind, domain, number_type, coding))
    payload += write_text(track.name) + write_text(track.unit) + write_varint(track.n_columns)
    return payload + stored.tobytes() + track.rows
