"""Other codecs in the comparison: their settings, and their packages, imported on demand."""

import io
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.sequence import MeshSequence, Vertices
from meshreel.runtime.extras import Extra
from meshreel.studies.study import checked_names

Array = npt.NDArray[Any]
Shape = tuple[int, int, int]
Words = npt.NDArray[np.uint16]

HEAD = struct.Struct("<4d")
"""Origin and quantization step before quantized differences."""

NONE = "none"
"""Selects no peers."""


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A codec of vertex positions, with a sweep of settings of one number each."""

    name: str
    """Name in tables and plots."""
    summary: str
    """One-line description of its use."""
    package: Extra | None
    """The package that it needs; None if Python and NumPy suffice."""
    encode: Callable[[MeshSequence, float], bytes]
    """Encodes a prepared sequence at a setting."""
    decode: Callable[..., Vertices]
    """Decodes positions, given the bytes, a shape and a type, in the codec's vertex order."""
    settings: tuple[float, ...] = (0,)
    quick: tuple[float, ...] = (0,)
    """All settings, and few."""
    params: str = ""
    """Format of a setting; empty for codecs without settings."""
    prepare: Callable[[MeshSequence], MeshSequence] | None = None
    """Returns the sequence to encode; not part of the timing."""
    restore: Callable[[Vertices, MeshSequence, float], Vertices] | None = None
    """Returns decoded positions in the order of the prepared sequence, given them, the sequence and
    the setting; not part of the timing.
    """
    has_faces: bool = False
    """Whether its bytes contain the faces."""
    takes_faces: bool = False
    """Whether `decode` also takes the faces."""
    source: str = ""
    """Identifies the code of a codec without package."""

    @property
    def is_available(self) -> bool:
        """Whether its package is installed."""
        return self.package is None or self.package.is_installed

    @property
    def version(self) -> str:
        """The version of its package, or `source`."""
        return version(self.package.library) if self.package else self.source


def peers_named(names: Iterable[str] | None, peers: Sequence[Peer]) -> tuple[Peer, ...]:
    """Return the peers of these names, in their order; none for "none", all for None.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    if names is None:
        return tuple(peers)
    selected = set(names)
    if selected == {NONE}:
        return ()
    known = checked_names(selected, [peer.name for peer in peers], "peer")
    return tuple(peer for peer in peers if peer.name in known)


def why_missing(peers: Iterable[Peer]) -> list[str]:
    """A line for each peer whose package is missing, with the command that installs it."""
    return [
        f"`{peer.name}` was not measured: it needs the package {peer.package.library} "
        f"({peer.package.command})"
        for peer in peers
        if peer.package and not peer.is_available
    ]


def planar(vertices: Vertices) -> Vertices:
    """Positions as an array of shape (T, 3 V): all x, then all y, then all z of a frame.

    On two sequences, streams are smaller than with interleaved coordinates: by a third for zfp
    and by half for SZ3.
    """
    planes: Vertices = vertices.transpose(0, 2, 1)
    return planes.reshape(len(vertices), -1)


def interleaved(rows: Vertices, shape: Shape) -> Vertices:
    """The inverse of `planar`."""
    n_frames, n_verts, _ = shape
    vertices: Vertices = rows.reshape(n_frames, 3, n_verts).transpose(0, 2, 1)
    return vertices.copy()


def tolerance_of(sequence: MeshSequence, share: float) -> float:
    """A fraction of the sequence's diagonal, in model units."""
    diagonal = bounding_box_reference(sequence.vertices).diagonal
    if not 0 < diagonal < np.inf:
        raise InvalidInputError(
            "a relative error bound needs an extent; the sequence has no extent"
        )
    return float(share * diagonal)


def pack_frames(frames: Iterable[bytes]) -> bytes:
    """Concatenate streams, each preceded by its length."""
    return b"".join(struct.pack("<I", len(frame)) + frame for frame in frames)


def unpack_frames(data: bytes) -> list[bytes]:
    """The inverse of `pack_frames`."""
    frames, position = [], 0
    while position < len(data):
        (length,) = struct.unpack_from("<I", data, position)
        position += 4
        frames.append(data[position : position + length])
        position += length
    return frames


def zfp_bytes(array: Array, tolerance: float) -> bytes:
    """Compress floats with zfp, losslessly if the tolerance is 0.

    References
    ----------
    P. Lindstrom, "Fixed-rate compressed floating-point arrays", TVCG 20(12), 2014.
    """
    accuracy = {"tolerance": tolerance} if tolerance else {}
    return bytes(import_module("zfpy").compress_numpy(np.ascontiguousarray(array), **accuracy))


def zfp_array(data: bytes) -> Array:
    """Decompress a zfp stream to its original shape."""
    return np.asarray(import_module("zfpy").decompress_numpy(data))


def sz3_bytes(array: Array, tolerance: float, algorithm: str) -> bytes:
    """Compress floats with SZ3 and an absolute error bound.

    Parameters
    ----------
    algorithm : str
        Member of `pysz.szAlgorithm`, such as "LORENZO_REG" or "INTERP_LORENZO".

    References
    ----------
    X. Liang et al., "SZ3: a modular framework for composing prediction-based error-bounded lossy
    compressors", IEEE Transactions on Big Data 9(2), 2023.
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


def quantized_deltas(vertices: Vertices, bits: float) -> tuple[bytes, Words]:
    """Header, and temporal differences of quantized positions modulo 2^16, shape (T, V, 3).

    Parameters
    ----------
    vertices : float array of shape (T, V, 3)
    bits : float
        Bits for the longest side of the bounding box of the whole sequence; at most 16.
    """
    corner = vertices.min(axis=(0, 1)).astype(np.float64)
    extent = float(np.max(vertices.max(axis=(0, 1)) - corner))
    step = extent / (2**bits - 1) or 1.0
    words = np.rint((vertices - corner) / step).astype(np.uint16)
    return HEAD.pack(*corner, step), np.diff(words, axis=0, prepend=np.uint16(0))


def positions_of_deltas(head: bytes, deltas: Words, dtype: npt.DTypeLike) -> Vertices:
    """The inverse of `quantized_deltas`, up to half a quantization step."""
    *corner, step = HEAD.unpack(head)
    words = np.cumsum(deltas, axis=0, dtype=np.uint16)
    vertices: Vertices = (words * step + np.array(corner)).astype(np.dtype(dtype))
    return vertices


def _meshopt_encode(sequence: MeshSequence, bits: float) -> bytes:
    """The coded differences of all frames, compressed together.

    The codec expects a general compressor after it; LZMA is the only one in Python's standard
    library whose window spans several frames.
    """
    meshoptimizer = import_module("meshoptimizer")
    meshoptimizer.encode_vertex_version(1)
    head, deltas = quantized_deltas(sequence.vertices, bits)
    padded = np.zeros((*deltas.shape[:2], 4), np.uint16)  # vertex sizes: multiples of 4 bytes
    padded[..., :3] = deltas
    frames = (bytes(meshoptimizer.encode_vertex_buffer(frame, len(frame), 8)) for frame in padded)
    compressed: bytes = import_module("lzma").compress(pack_frames(frames))
    return head + compressed


def _meshopt_decode(data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
    decode = import_module("meshoptimizer").decode_vertex_buffer
    frames = unpack_frames(import_module("lzma").decompress(data[HEAD.size :]))
    # The binding returns floats; four words of a vertex are reinterpreted from two floats.
    words = [np.asarray(decode(shape[1], 8, frame)).view(np.uint16) for frame in frames]
    deltas = np.stack(words).reshape(shape[0], shape[1], 4)[..., :3]
    return positions_of_deltas(data[: HEAD.size], deltas, dtype)


def _pcodec_encode(sequence: MeshSequence, bits: float) -> bytes:
    head, deltas = quantized_deltas(sequence.vertices, bits)
    return head + pcodec_bytes(np.ascontiguousarray(deltas.transpose(2, 0, 1)).view(np.int16))


def _pcodec_decode(data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
    words = np.asarray(pcodec_array(data[HEAD.size :]), np.int16).view(np.uint16)
    deltas = words.reshape(3, *shape[:2]).transpose(1, 2, 0)
    return positions_of_deltas(data[: HEAD.size], deltas, dtype)


def _blosc2_encode(sequence: MeshSequence, level: float) -> bytes:
    """One Blosc2 chunk, ordered by trajectory."""
    blosc2 = import_module("blosc2")
    trajectories = np.ascontiguousarray(planar(sequence.vertices).T)
    return bytes(
        blosc2.compress2(
            trajectories, codec=blosc2.Codec.ZSTD, clevel=int(level),
            filters=[blosc2.Filter.SHUFFLE], typesize=trajectories.itemsize,
        )
    )  # fmt: skip


def _blosc2_decode(data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
    values = np.frombuffer(import_module("blosc2").decompress2(data), dtype)
    return interleaved(np.ascontiguousarray(values.reshape(-1, shape[0]).T), shape)


def _npz_encode(sequence: MeshSequence, _: float) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, vertices=sequence.vertices)
    return stream.getvalue()


def _npz_decode(data: bytes, _shape: Shape, _dtype: npt.DTypeLike) -> Vertices:
    with np.load(io.BytesIO(data)) as arrays:
        vertices: Vertices = arrays["vertices"]
    return vertices


QUICK_BITS, BITS = (10, 12), (8, 9, 10, 12, 14)
"""Bits per coordinate in the bounding box of the sequence."""

ARRAY_PEERS = (
    Peer(
        name="sz3",
        summary="SZ3, absolute error bound, Lorenzo and regression, on a (T, 3 V) array",
        package=Extra("peers", "pysz", "pysz"),
        encode=lambda sequence, share: sz3_bytes(
            planar(sequence.vertices), tolerance_of(sequence, share), "LORENZO_REG"
        ),
        decode=lambda data, shape, dtype: interleaved(
            sz3_array(data, (shape[0], 3 * shape[1]), dtype), shape
        ),
        settings=(4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4),
        quick=(2e-3, 5e-4),
        params="bound {:g}",
    ),
    Peer(
        name="zfp",
        summary="zfp, fixed accuracy, on a (T, 3 V) array; its bound is seldom reached",
        package=Extra("peers", "zfpy", "zfpy"),
        encode=lambda sequence, share: zfp_bytes(
            planar(sequence.vertices), tolerance_of(sequence, share)
        ),
        decode=lambda data, shape, _: interleaved(zfp_array(data), shape),
        settings=(3e-2, 1e-2, 3e-3, 1e-3, 3e-4),
        quick=(1e-2, 1e-3),
        params="bound {:g}",
    ),
    Peer(
        name="meshopt",
        summary="meshoptimizer's vertex codec and LZMA on temporal differences of quantized "
        "positions",
        package=Extra("meshopt", "meshoptimizer", "meshoptimizer"),
        encode=_meshopt_encode,
        decode=_meshopt_decode,
        settings=BITS,
        quick=QUICK_BITS,
        params="{:g} bits",
    ),
    Peer(
        name="pco",
        summary="pcodec on temporal differences of quantized positions",
        package=Extra("peers", "pcodec", "pcodec"),
        encode=_pcodec_encode,
        decode=_pcodec_decode,
        settings=BITS,
        quick=QUICK_BITS,
        params="{:g} bits",
    ),
    Peer(
        name="blosc2",
        summary="Blosc2, byte shuffle and zstd level 9, lossless, on a (3 V, T) array",
        package=Extra("peers", "blosc2", "blosc2"),
        encode=_blosc2_encode,
        decode=_blosc2_decode,
        settings=(9,),
        quick=(9,),
        params="level {:g}",
    ),
    Peer(
        name="npz",
        summary="numpy.savez_compressed (deflate), lossless",
        package=None,
        encode=_npz_encode,
        decode=_npz_decode,
    ),
)
"""Compressors of float arrays; bounds are fractions of the diagonal."""
