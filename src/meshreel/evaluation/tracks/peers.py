"""Array compressors, applied to the values of a track."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.evaluation.choices import checked_names
from meshreel.evaluation.codecs.peers.arrays import (
    fpzip_array,
    fpzip_bytes,
    pcodec_array,
    pcodec_bytes,
    sz3_array,
    sz3_bytes,
    zfp_array,
    zfp_bytes,
)
from meshreel.evaluation.codecs.peers.integer_deltas import pack_frames, unpack_frames
from meshreel.evaluation.codecs.peers.protocol import NONE

Shape = tuple[int, int, int]


class TrackPeer(Protocol):
    """A compressor of arrays of shape (T, N, C)."""

    @property
    def name(self) -> str:
        """Name in tables and plots."""

    @property
    def summary(self) -> str:
        """One-line description of its use."""

    @property
    def package(self) -> str:
        """Required package."""

    @property
    def extra(self) -> str:
        """The extra of meshreel that installs the package."""

    @property
    def grain(self) -> float:
        """Tolerances whose ratio is below this may give the same bytes."""

    @property
    def is_reversible(self) -> bool:
        """Whether a tolerance of 0 is lossless."""

    def encode(self, values: Values, tolerance: float) -> bytes:
        """Encode values; the tolerance is approximately the largest error of a number."""

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Values:
        """Decode values of a shape and type."""


@dataclass(frozen=True)
class Sz3:
    """SZ3 with an absolute bound, on a (T, N) array for each column."""

    name: str = "sz3"
    summary: str = (
        "SZ3, absolute error bound, the smaller of interpolation and of Lorenzo and regression, "
        "on a (T, N) array for each column"
    )
    package: str = "pysz"
    extra: str = "peers"
    grain: float = 1.02
    is_reversible: bool = False

    def encode(self, values: Values, tolerance: float) -> bytes:
        """One stream per column."""
        algorithms = ("INTERP_LORENZO", "LORENZO_REG")
        return pack_frames(
            [
                min((sz3_bytes(column, tolerance, name) for name in algorithms), key=len)
                for column in columns_of(values)
            ]
        )

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Values:
        """The inverse of `encode`."""
        parts = unpack_frames(data)
        return np.stack([sz3_array(part, shape[:2], dtype) for part in parts], axis=2)


@dataclass(frozen=True)
class Zfp:
    """zfp with fixed accuracy, on a (T, N) array for each column."""

    name: str = "zfp"
    summary: str = "zfp, fixed accuracy or reversible, on a (T, N) array for each column"
    package: str = "zfpy"
    extra: str = "peers"
    grain: float = 2.0  # zfp rounds its tolerance to a power of two
    is_reversible: bool = True

    def encode(self, values: Values, tolerance: float) -> bytes:
        """One stream per column."""
        return pack_frames([zfp_bytes(column, tolerance) for column in columns_of(values)])

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Values:
        """The inverse of `encode`."""
        return np.stack([zfp_array(part) for part in unpack_frames(data)], axis=2)


@dataclass(frozen=True)
class Pcodec:
    """pcodec on numbers quantized by twice the tolerance, or on the numbers themselves."""

    name: str = "pco"
    summary: str = (
        "pcodec on numbers in steps, the smaller of their differences over time and of all times "
        "of a place in a row; on the numbers themselves where nothing may change"
    )
    package: str = "pcodec"
    extra: str = "peers"
    grain: float = 1.02
    is_reversible: bool = True

    def encode(self, values: Values, tolerance: float) -> bytes:
        """The tolerance, a digit for the memory layout, and a pcodec file."""
        numbers = _quantize(values, tolerance) if tolerance else values
        rows = b"1" + pcodec_bytes(numbers.transpose(2, 1, 0))
        if tolerance:
            over_time = np.diff(numbers, axis=0, prepend=numbers.dtype.type(0))
        else:
            over_time = numbers
        planes = b"0" + pcodec_bytes(over_time.transpose(2, 0, 1))
        return np.float64(tolerance).tobytes() + min(rows, planes, key=len)

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Values:
        """The inverse of `encode`, up to half a step."""
        tolerance = float(np.frombuffer(data[:8], np.float64)[0])
        (n_frames, n_items, n_columns), numbers = shape, pcodec_array(data[9:])
        if data[8:9] == b"1":
            values = numbers.reshape(n_columns, n_items, n_frames).transpose(2, 1, 0)
        else:
            values = numbers.reshape(n_columns, n_frames, n_items).transpose(1, 2, 0)
            values = np.cumsum(values, axis=0, dtype=values.dtype) if tolerance else values
        return np.asarray((values * (2 * tolerance)).astype(dtype) if tolerance else values)


@dataclass(frozen=True)
class Fpzip:
    """fpzip with as many bits per float as the largest value needs for the tolerance."""

    name: str = "fpzip"
    summary: str = (
        "fpzip, on a (C, T, N) array; it keeps bits of each float, which the largest needs for all"
    )
    package: str = "fpzip"
    extra: str = "peers"
    grain: float = 2.0  # one bit
    is_reversible: bool = True

    def encode(self, values: Values, tolerance: float) -> bytes:
        """One stream."""
        if values.dtype.kind != "f":
            raise InvalidInputError(f"fpzip takes float32 and float64; got {values.dtype}")
        n_bits = 0
        if tolerance:
            sign_and_exponent, width = (9, 32) if values.dtype.itemsize == 4 else (12, 64)
            largest = float(np.max(np.abs(values), initial=0.0))
            digits = math.log2(max(largest / tolerance, 1.0))
            n_bits = min(max(sign_and_exponent + math.ceil(digits), 2), width)
            n_bits += n_bits % 2 if width == 64 else 0  # float64 needs an even precision
        return fpzip_bytes(values.transpose(2, 0, 1), n_bits)

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Values:
        """The values."""
        n_frames, n_items, n_columns = shape
        return fpzip_array(data, (n_columns, n_frames, n_items)).transpose(1, 2, 0)


TRACK_PEERS: tuple[TrackPeer, ...] = (Sz3(), Zfp(), Pcodec(), Fpzip())
TRACK_PEER_NAMES = tuple(peer.name for peer in TRACK_PEERS)


def track_peers_named(names: Iterable[str] = TRACK_PEER_NAMES) -> tuple[TrackPeer, ...]:
    """Return the peers of these names in registry order; none for "none".

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    selected = set(names)
    if selected == {NONE}:
        return ()
    known = checked_names(selected, TRACK_PEER_NAMES, "peer")
    return tuple(peer for peer in TRACK_PEERS if peer.name in known)


def columns_of(values: Values) -> list[Values]:
    """An array of shape (T, N) for each column."""
    return [np.ascontiguousarray(values[..., column]) for column in range(values.shape[2])]


def _quantize(values: Values, tolerance: float) -> npt.NDArray[np.int32]:
    """Quantize numbers with a step of twice the tolerance."""
    steps = np.rint(values / (2 * tolerance))
    if not np.abs(steps).max() < 2**30:
        raise InvalidInputError(f"steps of {2 * tolerance:g} are too fine for integers of 32 bits")
    return steps.astype(np.int32)
