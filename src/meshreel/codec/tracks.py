"""Tracks beside the positions: what a stream says of each before its first block."""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.codec.surface.texts import read_text, write_text
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.surface import Domain
from meshreel.tracks import COLUMNS_OF, MAX_COLUMNS, TrackKind
from meshreel.tracks import NUMBER_TYPES as ALL_NUMBER_TYPES

KINDS = (
    TrackKind.OTHER,
    TrackKind.VECTOR,
    TrackKind.VELOCITY,
    TrackKind.NORMAL,
    TrackKind.COLOR,
    TrackKind.UV,
    TrackKind.SCALAR,
)
DOMAINS = (Domain.VERTEX, Domain.FACE, Domain.CORNER)
NUMBER_TYPES = {
    dtype.itemsize + {"f": 0, "u": 16, "i": 32}[dtype.kind]: dtype for dtype in ALL_NUMBER_TYPES
}
"""Choices by their codes."""


@dataclass(frozen=True)
class TrackHeader:
    """What a track is, and how its numbers lie in their range.

    Attributes
    ----------
    name, unit : str
    kind : TrackKind
    domain : Domain
        Where its values are; faces are polygons, corners are theirs.
    dtype : numpy dtype
        Of its numbers.
    scale : float
        Positive.
    origin : tuple of C floats
        Numbers are scale times what is coded plus the origin of their column.
    is_exact : bool
        Whether its numbers come back as they were; scale and origin then mean nothing.
    bound : float
        Largest error of a value that the encoder has made sure of: in units of the track, of
        normals in degrees; of colours of each number. 0 promises nothing.
    """

    name: str
    unit: str
    kind: TrackKind
    domain: Domain
    dtype: np.dtype[Any]
    scale: float
    origin: tuple[float, ...]
    is_exact: bool = False
    bound: float = 0.0

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
    [number_type] = (code for code, dtype in NUMBER_TYPES.items() if dtype == track.dtype)
    kind, domain = KINDS.index(track.kind), DOMAINS.index(track.domain)
    said = bytes((kind, domain, number_type, track.is_exact))
    said += write_text(track.name) + write_text(track.unit) + write_varint(track.n_columns)
    if track.is_exact:
        return said
    return said + np.array((track.bound, *track.placement), "<f8").tobytes()


def read_track(payload: bytes) -> TrackHeader:
    """Undo `write_track`.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If it contradicts itself, or is cut off.
    """
    if len(payload) < 4:
        raise TruncatedStreamError("a track is cut off")
    kind, domain, number_type, coding = payload[:4]
    name, position = read_text(payload, 4)
    unit, position = read_text(payload, position)
    n_columns, position = read_varint(payload, position)
    known = kind < len(KINDS) and domain < len(DOMAINS) and number_type in NUMBER_TYPES
    if not known or coding > 1 or not 1 <= n_columns <= MAX_COLUMNS:
        raise CorruptStreamError(
            f"track {name!r} has kind {kind}, domain {domain}, number type {number_type}, coding "
            f"{coding} and {n_columns} columns; at most {MAX_COLUMNS} are allowed"
        )
    dtype, is_exact = NUMBER_TYPES[number_type], coding == 1
    if n_columns not in COLUMNS_OF[KINDS[kind]]:
        raise CorruptStreamError(f"track {name!r} has {n_columns} columns; {KINDS[kind]} has not")
    what = name, unit, KINDS[kind], DOMAINS[domain], dtype
    n_numbers = 0 if is_exact else 2 + n_columns
    if len(payload) - position != 8 * n_numbers or (dtype.kind != "f" and not is_exact):
        raise CorruptStreamError(
            f"track {name!r} of type {dtype} has {len(payload) - position} bytes of numbers; "
            f"{8 * n_numbers} are needed"
        )
    if is_exact:
        return TrackHeader(*what, 1.0, (0.0,) * n_columns, is_exact)
    bound, scale, *origin = struct.unpack_from(f"<{n_numbers}d", payload, position)
    if not (np.isfinite([bound, scale, *origin]).all() and scale > 0 and bound >= 0):
        raise CorruptStreamError(f"track {name!r} has a bound, scale or origin that cannot be")
    return TrackHeader(*what, scale, tuple(origin), is_exact, bound)
