"""Array compressors, applied to the values of a track."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.evaluation.peers import (
    Array,
    Shape,
    pack_frames,
    pcodec_array,
    pcodec_bytes,
    sz3_array,
    sz3_bytes,
    unpack_frames,
    zfp_array,
    zfp_bytes,
)
from meshreel.runtime.extras import Extra


@dataclass(frozen=True, kw_only=True)
class TrackPeer:
    """A compressor of the values of a track, of shape (T, N, C).

    Attributes
    ----------
    encode : callable
        Encodes values; the tolerance is approximately the largest error of a number.
    decode : callable
        Decodes values of a shape and type.
    grain : float
        Tolerances whose ratio is below this may give the same bytes.
    is_reversible : bool
        Whether a tolerance of 0 is lossless.
    """

    name: str
    package: Extra
    encode: Callable[[Array, float], bytes]
    decode: Callable[[bytes, Shape, npt.DTypeLike], Array]
    grain: float = 1.02
    is_reversible: bool = True


def _columns_of(values: Array) -> list[Array]:
    """An array of shape (T, N) for each column."""
    return [np.ascontiguousarray(values[..., column]) for column in range(values.shape[2])]


def _sz3_encode(values: Array, tolerance: float) -> bytes:
    """One stream per column, the smaller of two algorithms."""
    algorithms = ("INTERP_LORENZO", "LORENZO_REG")
    return pack_frames(
        min((sz3_bytes(column, tolerance, name) for name in algorithms), key=len)
        for column in _columns_of(values)
    )


def _sz3_decode(data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Array:
    return np.stack([sz3_array(part, shape[:2], dtype) for part in unpack_frames(data)], axis=2)


def _zfp_encode(values: Array, tolerance: float) -> bytes:
    """One stream per column."""
    return pack_frames(zfp_bytes(column, tolerance) for column in _columns_of(values))


def _zfp_decode(data: bytes, _shape: Shape, _dtype: npt.DTypeLike) -> Array:
    return np.stack([zfp_array(part) for part in unpack_frames(data)], axis=2)


def _pcodec_encode(values: Array, tolerance: float) -> bytes:
    """The tolerance, a digit for the memory layout, and a pcodec file."""
    numbers = _quantize(values, tolerance) if tolerance else values
    rows = b"1" + pcodec_bytes(numbers.transpose(2, 1, 0))
    over_time = np.diff(numbers, axis=0, prepend=numbers.dtype.type(0)) if tolerance else numbers
    planes = b"0" + pcodec_bytes(over_time.transpose(2, 0, 1))
    return np.float64(tolerance).tobytes() + min(rows, planes, key=len)


def _pcodec_decode(data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Array:
    """The inverse of `_pcodec_encode`, up to half a step."""
    tolerance = float(np.frombuffer(data[:8], np.float64)[0])
    (n_frames, n_items, n_columns), numbers = shape, pcodec_array(data[9:])
    if data[8:9] == b"1":
        values = numbers.reshape(n_columns, n_items, n_frames).transpose(2, 1, 0)
    else:
        values = numbers.reshape(n_columns, n_frames, n_items).transpose(1, 2, 0)
        values = np.cumsum(values, axis=0, dtype=values.dtype) if tolerance else values
    return np.asarray((values * (2 * tolerance)).astype(dtype) if tolerance else values)


def _quantize(values: Array, tolerance: float) -> npt.NDArray[np.int32]:
    """Quantize numbers with a step of twice the tolerance."""
    steps = np.rint(values / (2 * tolerance))
    if not np.abs(steps).max() < 2**30:
        raise InvalidInputError(f"steps of {2 * tolerance:g} are too fine for integers of 32 bits")
    return steps.astype(np.int32)


def _fpzip_encode(values: Array, tolerance: float) -> bytes:
    """One stream of as many bits per float as the largest value needs for the tolerance."""
    if values.dtype.kind != "f":
        raise InvalidInputError(f"fpzip takes float32 and float64; got {values.dtype}")
    n_bits = 0
    if tolerance:
        sign_and_exponent, width = (9, 32) if values.dtype.itemsize == 4 else (12, 64)
        largest = float(np.max(np.abs(values), initial=0.0))
        digits = math.log2(max(largest / tolerance, 1.0))
        n_bits = min(max(sign_and_exponent + math.ceil(digits), 2), width)
        n_bits += n_bits % 2 if width == 64 else 0  # float64 needs an even precision
    # fpzip rejects read-only memory.
    writable = np.require(values.transpose(2, 0, 1), requirements=["C", "W"])
    return bytes(import_module("fpzip").compress(writable, precision=n_bits, order="C"))


def _fpzip_decode(data: bytes, shape: Shape, _dtype: npt.DTypeLike) -> Array:
    n_frames, n_items, n_columns = shape
    array = np.asarray(import_module("fpzip").decompress(data, order="C"))
    return array.reshape(n_columns, n_frames, n_items).transpose(1, 2, 0)


TRACK_PEERS = (
    # Absolute error bound.
    TrackPeer(
        name="sz3",
        package=Extra("peers", "pysz", "pysz"),
        encode=_sz3_encode,
        decode=_sz3_decode,
        is_reversible=False,
    ),
    # Fixed accuracy or reversible; it rounds its tolerance to a power of two.
    TrackPeer(
        name="zfp",
        package=Extra("peers", "zfpy", "zfpy"),
        encode=_zfp_encode,
        decode=_zfp_decode,
        grain=2.0,
    ),
    TrackPeer(
        name="pco",
        package=Extra("peers", "pcodec", "pcodec"),
        encode=_pcodec_encode,
        decode=_pcodec_decode,
    ),
    TrackPeer(
        name="fpzip",
        package=Extra("peers", "fpzip", "fpzip"),
        encode=_fpzip_encode,
        decode=_fpzip_decode,
        grain=2.0,  # one bit
    ),
)
