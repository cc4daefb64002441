"""Draco, applied to each frame separately."""

from dataclasses import dataclass
from importlib import import_module

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, n_equal_before
from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.integer_deltas import pack_frames, unpack_frames
from meshreel.evaluation.codecs.peers.protocol import Shape
from meshreel.model.sequence import MeshSequence, Vertices

LEVEL = 7
Floats32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Draco:
    """Draco through DracoPy; every frame contains the connectivity, and the order is lost."""

    name: str = "draco"
    summary: str = f"Draco, level {LEVEL}, each frame for itself with its connectivity"
    package: str = "DracoPy"
    extra: str = "peers"
    has_faces: bool = True

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Bits per coordinate in the bounding box of a frame."""
        return (9, 11) if quick else (8, 9, 10, 11, 12)

    def params(self, setting: float) -> str:
        """The quantization parameter."""
        return f"qp {setting:g}"

    def prepare(self, sequence: MeshSequence) -> MeshSequence:
        """The sequence in float32 with distinct positions.

        Draco merges equal positions, which would change the mesh from frame to frame.
        """
        frames = [separate_equal(frame) for frame in sequence.vertices.astype(np.float32)]
        return MeshSequence(np.stack(frames), sequence.faces, sequence.fps, sequence.name)

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """The streams of all frames, each preceded by its length in 4 bytes."""
        faces = sequence.faces.astype(np.uint32)
        return pack_frames([_encode_frame(v, faces, int(setting)) for v in sequence.vertices])

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in Draco's order, which may repeat a vertex."""
        draco = import_module("DracoPy")
        frames = [np.asarray(draco.decode(frame).points) for frame in unpack_frames(data)]
        if len({frame.shape for frame in frames}) != 1:
            raise InvalidInputError("Draco gives frames of different vertex counts")
        return np.stack(frames).astype(np.float32)

    def restore(self, decoded: Vertices, prepared: MeshSequence, setting: float) -> Vertices:
        """Reorder decoded positions by vertex, and check their quantization errors.

        Raises
        ------
        InvalidInputError
            If Draco dropped vertices, or their order cannot be reconstructed.
        """
        vertex_of_point = draco_order(prepared)
        n_lost = prepared.n_verts - len(np.unique(vertex_of_point))
        if n_lost:
            raise InvalidInputError(
                f"Draco drops {n_lost} of {prepared.n_verts} vertices (no face uses them)"
            )
        if len(vertex_of_point) != decoded.shape[1]:
            raise InvalidInputError(
                f"Draco returns {decoded.shape[1]} positions, but {len(vertex_of_point)} for the "
                "same faces with numbered vertices: cannot match positions to vertices"
            )
        vertices = np.empty_like(prepared.vertices)
        vertices[:, vertex_of_point] = decoded
        _require_close(vertices, prepared.vertices, int(setting))
        return vertices


def draco_order(sequence: MeshSequence) -> Integers:
    """Return the vertex of each point of a decoded frame, shape (P,).

    Draco's order follows from the faces alone, so it can be read from a stream in which the
    position of each vertex is its number.
    """
    bits = max((sequence.n_verts - 1).bit_length(), 1)
    numbered = np.zeros((sequence.n_verts, 3), np.float32)
    numbered[:, 0] = np.arange(sequence.n_verts)
    draco = import_module("DracoPy")
    stream = draco.encode(
        numbered,
        sequence.faces.astype(np.uint32),
        quantization_bits=bits,
        compression_level=LEVEL,
        quantization_range=float((1 << bits) - 1),
        quantization_origin=[0, 0, 0],
        create_metadata=False,
    )
    points = np.asarray(draco.decode(bytes(stream)).points)
    numbers: Integers = np.rint(points[:, 0]).astype(np.int64)
    return numbers


def separate_equal(frame: Floats32) -> Floats32:
    """Make positions distinct: move repeated ones in x by as few ulps as possible."""
    positions = np.ascontiguousarray(frame).copy()
    while True:
        rows = positions.view(f"V{positions.itemsize * 3}").ravel()
        _, group = np.unique(rows, return_inverse=True)
        rank = n_equal_before(group).astype(np.int32)
        if not rank.any():
            return positions
        positions.view(np.int32)[:, 0] += rank


def _encode_frame(vertices: Vertices, faces: npt.NDArray[np.uint32], bits: int) -> bytes:
    return bytes(
        import_module("DracoPy").encode(
            vertices, faces, quantization_bits=bits, compression_level=LEVEL, create_metadata=False
        )
    )


def _require_close(decoded: Vertices, original: Vertices, bits: int) -> None:
    """Check that every coordinate is within half a quantization step of its original.

    Raises
    ------
    InvalidInputError
        If one is not: then the order differs from that of the numbered vertices.
    """
    step = np.ptp(original.astype(np.float64), axis=1).max(axis=1) / (2**bits - 1)
    slack = 8 * np.finfo(np.float32).eps * np.abs(original).max()
    distance = np.abs(decoded.astype(np.float64) - original).max(axis=(1, 2))
    if (distance > 0.501 * step + slack).any():
        raise InvalidInputError(
            "Draco orders the vertices of the frames differently from numbered ones: cannot match "
            "positions to vertices"
        )
