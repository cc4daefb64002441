"""Draco, every frame a mesh of its own."""

from dataclasses import dataclass

import DracoPy
import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.integer_deltas import pack_frames, unpack_frames
from meshreel.evaluation.codecs.peers.protocol import Shape
from meshreel.model.sequence import MeshSequence, Vertices

LEVEL = 7
Floats32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Draco:
    """Draco through DracoPy; each frame carries its connectivity, the order is dropped."""

    name: str = "draco"
    summary: str = f"Draco, level {LEVEL}, each frame for itself with its connectivity"
    package: str = "DracoPy"
    extra: str = "peers"
    has_faces: bool = True

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Bits of a coordinate in the box of its frame."""
        return (9, 11) if quick else (8, 9, 10, 11, 12)

    def params(self, setting: float) -> str:
        """The bits."""
        return f"qp {setting:g}"

    def prepare(self, sequence: MeshSequence) -> MeshSequence:
        """The sequence in float32, with positions that are bitwise equal set apart.

        Draco would merge them, and so change the mesh from frame to frame.
        """
        frames = [separated(frame) for frame in sequence.vertices.astype(np.float32)]
        return MeshSequence(np.stack(frames), sequence.faces, sequence.fps, sequence.name)

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """The streams of all frames, 4 bytes before each for its length."""
        faces = sequence.faces.astype(np.uint32)
        return pack_frames([_encode_frame(v, faces, int(setting)) for v in sequence.vertices])

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the order of Draco, in which a vertex may stand more than once."""
        frames = [np.asarray(DracoPy.decode(frame).points) for frame in unpack_frames(data)]
        if len({frame.shape for frame in frames}) != 1:
            raise InvalidInputError("Draco gives frames of different vertex counts")
        return np.stack(frames).astype(np.float32)

    def restore(self, decoded: Vertices, prepared: MeshSequence, setting: float) -> Vertices:
        """The decoded positions by vertex; each is checked to lie where Draco may put it.

        Raises
        ------
        InvalidInputError
            If Draco left out vertices, or gave them in an order that cannot be found.
        """
        vertex_of_point = draco_order(prepared)
        n_lost = prepared.n_verts - len(np.unique(vertex_of_point))
        if n_lost:
            raise InvalidInputError(
                f"Draco leaves out {n_lost} of {prepared.n_verts} vertices (no face uses them)"
            )
        if len(vertex_of_point) != decoded.shape[1]:
            raise InvalidInputError(
                f"Draco gives {decoded.shape[1]} positions, and {len(vertex_of_point)} for the "
                "same faces with numbered vertices: which belongs to which cannot be told"
            )
        vertices = np.empty_like(prepared.vertices)
        vertices[:, vertex_of_point] = decoded
        _require_close(vertices, prepared.vertices, int(setting))
        return vertices


def draco_order(sequence: MeshSequence) -> Integers:
    """The vertex that each point of a decoded frame is, shape (P,).

    Draco's order follows from the faces alone, so it is read from a stream in which each
    vertex's position is its number.
    """
    bits = max((sequence.n_verts - 1).bit_length(), 1)
    numbered = np.zeros((sequence.n_verts, 3), np.float32)
    numbered[:, 0] = np.arange(sequence.n_verts)
    stream = DracoPy.encode(
        numbered,
        sequence.faces.astype(np.uint32),
        quantization_bits=bits,
        compression_level=LEVEL,
        quantization_range=float((1 << bits) - 1),
        quantization_origin=[0, 0, 0],
        create_metadata=False,
    )
    points = np.asarray(DracoPy.decode(bytes(stream)).points)
    numbers: Integers = np.rint(points[:, 0]).astype(np.int64)
    return numbers


def separated(frame: Floats32) -> Floats32:
    """The positions, those that repeat an earlier one moved in x by as few ulps as it takes."""
    apart = np.ascontiguousarray(frame).copy()
    while True:
        rows = apart.view(f"V{apart.itemsize * 3}").ravel()
        _, group = np.unique(rows, return_inverse=True)
        order = np.argsort(group, kind="stable")
        starts = np.searchsorted(group[order], group[order])
        rank = np.empty(len(rows), np.int32)
        rank[order] = np.arange(len(rows)) - starts
        if not rank.any():
            return apart
        apart.view(np.int32)[:, 0] += rank


def _encode_frame(vertices: Vertices, faces: npt.NDArray[np.uint32], bits: int) -> bytes:
    return bytes(
        DracoPy.encode(
            vertices, faces, quantization_bits=bits, compression_level=LEVEL, create_metadata=False
        )
    )


def _require_close(decoded: Vertices, original: Vertices, bits: int) -> None:
    """Check that every coordinate is within half a quantisation step of its frame's box.

    Raises
    ------
    InvalidInputError
        If one is not: then the order is another than that of the numbered vertices.
    """
    step = np.ptp(original.astype(np.float64), axis=1).max(axis=1) / (2**bits - 1)
    slack = 8 * np.finfo(np.float32).eps * np.abs(original).max()
    distance = np.abs(decoded.astype(np.float64) - original).max(axis=(1, 2))
    if (distance > 0.501 * step + slack).any():
        raise InvalidInputError(
            "Draco orders the vertices of the frames otherwise than numbered ones: which decoded "
            "position belongs to which vertex cannot be told"
        )
