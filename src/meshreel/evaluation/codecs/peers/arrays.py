"""Compressors of float arrays: zfp, SZ3, pco, fpzip, blosc2 and NumPy's deflate."""

import io
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.protocol import Shape, interleaved, planar
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.sequence import MeshSequence, Vertices

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Zfp:
    """zfp with fixed accuracy, on an array of frames by coordinates.

    References
    ----------
    P. Lindstrom, "Fixed-rate compressed floating-point arrays", TVCG 20(12), 2014.
    """

    name: str = "zfp"
    summary: str = "zfp, fixed accuracy, on a (T, 3 V) array; its bound is seldom reached"
    package: str = "zfpy"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Error bounds per coordinate, as fractions of the diagonal."""
        return (1e-2, 1e-3) if quick else (3e-2, 1e-2, 3e-3, 1e-3, 3e-4)

    def params(self, setting: float) -> str:
        """The bound as text."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One zfp stream."""
        return zfp_bytes(planar(sequence.vertices), _tolerance(sequence, setting))

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        return interleaved(zfp_array(data), shape)


@dataclass(frozen=True)
class Sz3:
    """SZ3 with an absolute error bound and Lorenzo and regression predictors.

    References
    ----------
    X. Liang et al., "SZ3: a modular framework for composing prediction-based error-bounded lossy
    compressors", IEEE Transactions on Big Data 9(2), 2023.
    """

    name: str = "sz3"
    summary: str = "SZ3, absolute error bound, Lorenzo and regression, on a (T, 3 V) array"
    package: str = "pysz"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Error bounds per coordinate, as fractions of the diagonal."""
        return (2e-3, 5e-4) if quick else (4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)

    def params(self, setting: float) -> str:
        """The bound as text."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One SZ3 stream."""
        tolerance = _tolerance(sequence, setting)
        return sz3_bytes(planar(sequence.vertices), tolerance, "LORENZO_REG")

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        n_frames, n_verts, _ = shape
        return interleaved(sz3_array(data, (n_frames, 3 * n_verts), dtype), shape)


def _tolerance(sequence: MeshSequence, share: float) -> float:
    """A fraction of the sequence's diagonal, in model units."""
    diagonal = bounding_box_reference(sequence.vertices).diagonal
    if not 0 < diagonal < np.inf:
        raise InvalidInputError(
            "a relative error bound needs an extent; the sequence has no extent"
        )
    return float(share * diagonal)


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


@dataclass(frozen=True)
class Blosc2:
    """Byte shuffle and zstd, by Blosc2."""

    name: str = "blosc2"
    summary: str = "Blosc2, byte shuffle and zstd level 9, lossless, on a (3 V, T) array"
    package: str = "blosc2"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """The compression level, the only setting."""
        return (9,)

    def params(self, setting: float) -> str:
        """The level."""
        return f"level {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One Blosc2 chunk, ordered by trajectory."""
        blosc2 = import_module("blosc2")

        trajectories = np.ascontiguousarray(planar(sequence.vertices).T)
        return bytes(
            blosc2.compress2(
                trajectories,
                codec=blosc2.Codec.ZSTD,
                clevel=int(setting),
                filters=[blosc2.Filter.SHUFFLE],
                typesize=trajectories.itemsize,
            )
        )

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        blosc2 = import_module("blosc2")

        n_frames, n_verts, _ = shape
        trajectories = np.frombuffer(blosc2.decompress2(data), dtype).reshape(3 * n_verts, n_frames)
        return interleaved(np.ascontiguousarray(trajectories.T), shape)


@dataclass(frozen=True)
class Npz:
    """`numpy.savez_compressed`, the baseline of users without a mesh codec."""

    name: str = "npz"
    summary: str = "numpy.savez_compressed (deflate), lossless"
    package: None = None
    extra: None = None
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """A placeholder; there are no settings."""
        return (0,)

    def params(self, setting: float) -> str:
        """An empty text."""
        return ""

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One .npz with the positions."""
        stream = io.BytesIO()
        np.savez_compressed(stream, vertices=sequence.vertices)
        return stream.getvalue()

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        with np.load(io.BytesIO(data)) as arrays:
            vertices: Vertices = arrays["vertices"]
        return vertices
