"""Calls to array compressors: arrays to bytes, and bytes to arrays."""

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def zfp_bytes(array: Array, tolerance: float) -> bytes:
    """Compress floats with zfp, losslessly if the tolerance is 0."""
    zfpy = import_module("zfpy")
    accuracy = {"tolerance": tolerance} if tolerance else {}
    return bytes(zfpy.compress_numpy(np.ascontiguousarray(array), **accuracy))


def zfp_array(data: bytes) -> Array:
    """Decompress a zfp stream to its original shape."""
    return np.asarray(import_module("zfpy").decompress_numpy(data))


def sz3_bytes(array: Array, tolerance: float, algorithm: str) -> bytes:
    """Compress floats with SZ3 and an absolute error bound.

    Parameters
    ----------
    array : float array
    tolerance : float
        Largest error of a number.
    algorithm : str
        Member of `pysz.szAlgorithm`, such as "LORENZO_REG" or "INTERP_LORENZO".
    """
    pysz = import_module("pysz")
    config = pysz.szConfig()
    config.errorBoundMode = pysz.szErrorBoundMode.ABS
    config.absErrorBound = tolerance
    config.cmprAlgo = getattr(pysz.szAlgorithm, algorithm)
    compressed, _ = pysz.sz.compress(np.ascontiguousarray(array), config)
    return bytes(compressed)


def sz3_array(data: bytes, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Decompress an SZ3 stream."""
    pysz = import_module("pysz")
    array, _ = pysz.sz.decompress(np.frombuffer(data, np.uint8), np.dtype(dtype), shape)
    return np.asarray(array)


def pcodec_bytes(numbers: Array) -> bytes:
    """Compress numbers losslessly with pcodec, in memory order."""
    pcodec = import_module("pcodec")
    flat = np.ascontiguousarray(numbers).ravel()
    return bytes(pcodec.standalone.simple_compress(flat, pcodec.ChunkConfig()))


def pcodec_array(data: bytes) -> Array:
    """Decompress a pcodec file to shape (N,)."""
    return np.asarray(import_module("pcodec").standalone.simple_decompress(data))


def fpzip_bytes(array: Array, n_bits: int) -> bytes:
    """Compress an array of up to four axes with fpzip at `n_bits` per float; 0 is lossless."""
    fpzip = import_module("fpzip")
    writable = np.require(array, requirements=["C", "W"])  # fpzip rejects read-only memory
    return bytes(fpzip.compress(writable, precision=n_bits, order="C"))


def fpzip_array(data: bytes, shape: tuple[int, ...]) -> Array:
    """Decompress an fpzip stream."""
    return np.asarray(import_module("fpzip").decompress(data, order="C")).reshape(shape)
