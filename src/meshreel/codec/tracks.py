"""Tracks beside the positions: what a stream says of each before its first block."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from meshreel.codec.bitstream.container import write_text, write_varint
from meshreel.codec.surface.codes import DOMAINS
from meshreel.kernel.files import NUMBER_TYPES
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind

KINDS = (
    TrackKind.OTHER,
    TrackKind.VECTOR,
    TrackKind.VELOCITY,
    TrackKind.NORMAL,
    TrackKind.COLOR,
    TrackKind.UV,
    TrackKind.SCALAR,
)
"""In the order of their codes."""


class Sharing(IntEnum):
    """Which corners of faces always have equal values."""

    NONE = 0
    VERTICES = 1
    ROWS = 2


class Coding(IntEnum):
    """How values of a track are stored."""

    MODES = 0
    EXACT = 1
    TURNS = 2
    BACKWARD = 3
    CENTRAL = 4
    FORWARD = 5
    EXACT_BACKWARD = 6
    EXACT_CENTRAL = 7
    EXACT_FORWARD = 8

    @property
    def difference(self) -> "Coding | None":
        """The kind of difference of positions over time, times a rate, that predicts velocities."""
        if self in DIFFERENCES:
            return self
        return DIFFERENCES[EXACT_DIFFERENCES.index(self)] if self in EXACT_DIFFERENCES else None

    @property
    def has_rate(self) -> bool:
        """Whether differences of positions over time, times a rate, predict the track."""
        return self.difference is not None

    @property
    def is_predicted(self) -> bool:
        """Whether what is coded is what decoded positions leave: of velocities, or of normals."""
        return self is Coding.TURNS or self.has_rate

    @property
    def is_exact(self) -> bool:
        """Whether every bit comes back."""
        return self is Coding.EXACT or self in EXACT_DIFFERENCES

    @property
    def as_exact(self) -> "Coding":
        """The coding by the same difference whose values come back exactly."""
        return EXACT_DIFFERENCES[DIFFERENCES.index(self)]


DIFFERENCES = Coding.BACKWARD, Coding.CENTRAL, Coding.FORWARD
"""Of the position before, of those on both sides, of the one behind."""

EXACT_DIFFERENCES = Coding.EXACT_BACKWARD, Coding.EXACT_CENTRAL, Coding.EXACT_FORWARD
"""The same, of values that come back exactly."""

TURN_COLUMNS = 2
"""Numbers that turn a normal of the surface to that of a track."""


@dataclass(frozen=True)
class TrackHeader:
    """What a track is, and how its numbers lie in their range.

    Attributes
    ----------
    domain : Domain
        Where its values are; faces are polygons, corners are theirs.
    dtype : numpy dtype
        Of its numbers.
    scale : float
        Positive.
    origin : tuple of C floats
        Numbers are scale times what is coded plus the origin of their column, which is 0 unless
        they are coded by modes alone.
    coding : Coding
        If it is exact, scale and origin mean nothing.
    bound : float
        Largest error of a value that the encoder has made sure of: in units of the track, of
        normals in degrees; of colours of each number. 0 promises nothing.
    rate : float
        Of velocities that are predicted from positions: frames in the unit of time.
    sharing : Sharing
        Of corners: whether each has a value of its own, or one value is that of a vertex, or of a
        row.
    rows : bytes
        What rows there are, as `write_corner_rows` writes it.
    """

    name: str
    unit: str
    kind: TrackKind
    domain: Domain
    dtype: np.dtype[Any]
    scale: float
    origin: tuple[float, ...]
    coding: Coding = Coding.MODES
    bound: float = 0.0
    rate: float = 0.0
    sharing: Sharing = Sharing.NONE
    rows: bytes = b""

    @property
    def stored_domain(self) -> Domain:
        """Where the values that are stored are; they are of rows where these are of corners."""
        return Domain.VERTEX if self.sharing is Sharing.VERTICES else self.domain

    @property
    def is_exact(self) -> bool:
        """Whether its numbers come back as they were."""
        return self.coding.is_exact

    @property
    def n_columns(self) -> int:
        """C."""
        return len(self.origin)

    @property
    def n_coded(self) -> int:
        """Columns of what is coded."""
        return TURN_COLUMNS if self.coding is Coding.TURNS else self.n_columns

    @property
    def placement(self) -> tuple[float, ...]:
        """Scale, and origin of each column that is coded."""
        return self.scale, *self.origin[: self.n_coded]

    def __str__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        return f"{self.name!r}: {self.n_columns} x {self.dtype} of each {self.domain}{unit}"


def write_track(track: TrackHeader) -> bytes:
    """Payload of the section TRACK."""
    [number_type] = (code for code, dtype in NUMBER_TYPES.items() if dtype == track.dtype)
    kind, domain = KINDS.index(track.kind), DOMAINS.index(track.domain) + track.sharing
    said = bytes((kind, domain, number_type, track.coding))
    said += write_text(track.name) + write_text(track.unit) + write_varint(track.n_columns)
    numbers: tuple[float, ...] = ()
    if track.coding is Coding.MODES:
        numbers = track.bound, *track.placement
    elif track.coding is Coding.TURNS:
        numbers = track.bound, track.scale
    elif track.coding.has_rate:
        numbers = (track.rate,) if track.is_exact else (track.bound, track.scale, track.rate)
    return said + np.array(numbers, "<f8").tobytes() + track.rows
