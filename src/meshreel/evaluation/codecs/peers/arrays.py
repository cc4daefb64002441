"""Calls of compressors of arrays: arrays to bytes, and bytes to arrays."""

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def zfp_bytes(array: Array, tolerance: float) -> bytes:
    """A zfp stream of floats; reversible if the tolerance is 0."""
    zfpy = import_module("zfpy")
    accuracy = {"tolerance": tolerance} if tolerance else {}
    return bytes(zfpy.compress_numpy(np.ascontiguousarray(array), **accuracy))


def zfp_array(data: bytes) -> Array:
    """What a zfp stream holds, in the shape that it had."""
    return np.asarray(import_module("zfpy").decompress_numpy(data))


def sz3_bytes(array: Array, tolerance: float, algorithm: str) -> bytes:
    """A stream of SZ3 with an absolute bound.

    Parameters
    ----------
    array : float array
    tolerance : float
        Largest error of a number.
    algorithm : str
        Of `pysz.szAlgorithm`, such as "LORENZO_REG" or "INTERP_LORENZO".
    """
    pysz = import_module("pysz")
    config = pysz.szConfig()
    config.errorBoundMode = pysz.szErrorBoundMode.ABS
    config.absErrorBound = tolerance
    config.cmprAlgo = getattr(pysz.szAlgorithm, algorithm)
    compressed, _ = pysz.sz.compress(np.ascontiguousarray(array), config)
    return bytes(compressed)


def sz3_array(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """What a stream of SZ3 holds."""
    pysz = import_module("pysz")
    array, _ = pysz.sz.decompress(np.frombuffer(data, np.uint8), np.dtype(dtype), shape)
    return np.asarray(array)


def pcodec_bytes(numbers: Array) -> bytes:
    """A pcodec file of numbers, one after the other in memory; nothing is lost."""
    pcodec = import_module("pcodec")
    flat = np.ascontiguousarray(numbers).ravel()
    return bytes(pcodec.standalone.simple_compress(flat, pcodec.ChunkConfig()))


def pcodec_array(data: bytes) -> Array:
    """The numbers of a pcodec file, of shape (N,)."""
    return np.asarray(import_module("pcodec").standalone.simple_decompress(data))


def fpzip_bytes(array: Array, n_bits: int) -> bytes:
    """A stream of fpzip of up to four axes, with so many bits of each float; 0 for all."""
    fpzip = import_module("fpzip")
    own = np.require(array, requirements=["C", "W"])  # it takes no read-only memory
    return bytes(fpzip.compress(own, precision=n_bits, order="C"))


def fpzip_array(data: bytes, shape: tuple[int, ...]) -> Array:
    """What a stream of fpzip holds."""
    return np.asarray(import_module("fpzip").decompress(data, order="C")).reshape(shape)
