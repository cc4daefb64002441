"""Tracks beside the positions: what a stream says of each before its first block."""

import struct
from dataclasses import dataclass

import numpy as np

from meshreel.codec.surface.texts import read_text, write_text
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.surface import Domain

MAX_COLUMNS = 256
"""Most numbers of a track at a vertex and frame."""

KINDS = ("other", "vector", "velocity", "normal", "color", "uv")
DOMAINS = (Domain.VERTEX, Domain.FACE, Domain.CORNER)
NUMBER_TYPES: dict[int, np.dtype[np.floating]] = {
    4: np.dtype(np.float32),
    8: np.dtype(np.float64),
}
"""Choices by their codes."""


@dataclass(frozen=True)
class TrackHeader:
    """What a track is, and how its numbers lie in their range.

    Attributes
    ----------
    name, unit : str
    kind : str
        One of `KINDS`.
    domain : Domain
        Where its values are; faces are polygons, corners are theirs.
    dtype : numpy dtype
        Of its numbers, float32 or float64.
    scale : float
        Positive.
    origin : tuple of C floats
        Numbers are scale times what is coded plus the origin of their column.
    """

    name: str
    unit: str
    kind: str
    domain: Domain
    dtype: np.dtype[np.floating]
    scale: float
    origin: tuple[float, ...]

    @property
    def n_columns(self) -> int:
        """C."""
        return len(self.origin)

    @property
    def placement(self) -> tuple[float, ...]:
        """Scale, and origin of each column."""
        return self.scale, *self.origin

    def __str__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        return f"{self.name!r}: {self.n_columns} x {self.dtype} of each {self.domain}{unit}"


def write_track(track: TrackHeader) -> bytes:
    """Payload of the section TRACK."""
    codes = KINDS.index(track.kind), DOMAINS.index(track.domain), track.dtype.itemsize
    numbers = np.array(track.placement, "<f8").tobytes()
    named = write_text(track.name) + write_text(track.unit)
    return bytes(codes) + named + write_varint(track.n_columns) + numbers


def read_track(payload: bytes) -> TrackHeader:
    """Undo `write_track`.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If it contradicts itself, or is cut off.
    """
    if len(payload) < 3:
        raise TruncatedStreamError("a track is cut off")
    kind, domain, number_type = payload[:3]
    name, position = read_text(payload, 3)
    unit, position = read_text(payload, position)
    n_columns, position = read_varint(payload, position)
    known = kind < len(KINDS) and domain < len(DOMAINS) and number_type in NUMBER_TYPES
    if not known or not 1 <= n_columns <= MAX_COLUMNS:
        raise CorruptStreamError(
            f"track {name!r} has kind {kind}, domain {domain}, number type {number_type} and "
            f"{n_columns} columns; at most {MAX_COLUMNS} are allowed"
        )
    if len(payload) - position != 8 * (1 + n_columns):
        raise CorruptStreamError(f"track {name!r} does not have one scale and {n_columns} origins")
    scale, *origin = struct.unpack_from(f"<{1 + n_columns}d", payload, position)
    if not (np.isfinite([scale, *origin]).all() and scale > 0):
        raise CorruptStreamError(f"track {name!r} has a scale or origin that cannot be")
    place = scale, tuple(origin)
    return TrackHeader(name, unit, KINDS[kind], DOMAINS[domain], NUMBER_TYPES[number_type], *place)
