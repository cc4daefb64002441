"""Integer codecs on temporal differences of quantized positions."""

import lzma
import struct
from dataclasses import dataclass
from importlib import import_module

import numpy as np
import numpy.typing as npt

from meshreel.evaluation.codecs.peers.arrays import pcodec_array, pcodec_bytes
from meshreel.evaluation.codecs.peers.protocol import Shape
from meshreel.model.sequence import MeshSequence, Vertices

Words = npt.NDArray[np.uint16]
HEAD = struct.Struct("<4d")  # origin and quantization step
N_QUICK = (10, 12)
N_BITS = (8, 9, 10, 12, 14)


@dataclass(frozen=True)
class MeshOptimizer:
    """meshoptimizer's vertex codec on the differences of each frame, then LZMA.

    The codec expects a general compressor after it; LZMA is the only one in Python's standard
    library whose window spans several frames.
    """

    name: str = "meshopt"
    summary: str = (
        "meshoptimizer's vertex codec and LZMA on temporal differences of quantized positions"
    )
    package: str = "meshoptimizer"
    extra: str = "meshopt"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Bits per coordinate in the bounding box of the sequence."""
        return N_QUICK if quick else N_BITS

    def params(self, setting: float) -> str:
        """The bits."""
        return f"{setting:g} bits"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """The coded differences of all frames, compressed together."""
        meshoptimizer = import_module("meshoptimizer")

        meshoptimizer.encode_vertex_version(1)
        head, deltas = quantized_deltas(sequence.vertices, int(setting))
        padded = np.zeros((*deltas.shape[:2], 4), np.uint16)  # vertex sizes: multiples of 4 bytes
        padded[..., :3] = deltas
        frames = [bytes(meshoptimizer.encode_vertex_buffer(frame, len(frame), 8))
                  for frame in padded]  # fmt: skip
        return head + lzma.compress(pack_frames(frames))

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        meshoptimizer = import_module("meshoptimizer")

        frames = unpack_frames(lzma.decompress(data[HEAD.size :]))
        # The binding returns floats; four words of a vertex are reinterpreted from two floats.
        words = [
            np.asarray(meshoptimizer.decode_vertex_buffer(shape[1], 8, frame)).view(np.uint16)
            for frame in frames
        ]
        deltas = np.stack(words).reshape(shape[0], shape[1], 4)[..., :3]
        return positions_of_deltas(data[: HEAD.size], deltas, dtype)


@dataclass(frozen=True)
class Pcodec:
    """pcodec on the differences, one coordinate plane at a time."""

    name: str = "pco"
    summary: str = "pcodec on temporal differences of quantized positions"
    package: str = "pcodec"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Bits per coordinate in the bounding box of the sequence."""
        return N_QUICK if quick else N_BITS

    def params(self, setting: float) -> str:
        """The bits."""
        return f"{setting:g} bits"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One pcodec file."""
        head, deltas = quantized_deltas(sequence.vertices, int(setting))
        return head + pcodec_bytes(np.ascontiguousarray(deltas.transpose(2, 0, 1)).view(np.int16))

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        numbers = pcodec_array(data[HEAD.size :])
        n_frames, n_verts, _ = shape
        deltas = np.asarray(numbers, np.int16).view(np.uint16).reshape(3, n_frames, n_verts)
        return positions_of_deltas(data[: HEAD.size], deltas.transpose(1, 2, 0), dtype)


def quantized_deltas(vertices: Vertices, bits: int) -> tuple[bytes, Words]:
    """Header, and temporal differences of quantized positions modulo 2^16, shape (T, V, 3).

    Parameters
    ----------
    vertices : float array of shape (T, V, 3)
    bits : int
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


def pack_frames(frames: list[bytes]) -> bytes:
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
