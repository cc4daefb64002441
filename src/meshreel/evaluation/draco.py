"""Draco, applied to each frame separately."""

from collections.abc import Iterable
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers, n_equal_before
from meshreel.errors import InvalidInputError
from meshreel.evaluation.peers import Peer, Shape, pack_frames, unpack_frames
from meshreel.model.sequence import Faces, MeshSequence, Vertices
from meshreel.runtime.extras import Extra

LEVEL = 7
Floats32 = npt.NDArray[np.float32]


def encode_frames(frames: Iterable[tuple[Vertices, Faces]], bits: float, **options: Any) -> bytes:
    """The streams of all frames, each preceded by its length in 4 bytes.

    Parameters
    ----------
    frames : iterable of (vertices, faces)
    bits : float
        Bits per coordinate.
    **options
        `quantization_range` and `quantization_origin` of DracoPy; by default those of each frame.
    """
    return pack_frames(
        _encode(vertices, faces, quantization_bits=int(bits), **options)
        for vertices, faces in frames
    )


def decode_frames(data: bytes) -> list[Any]:
    """The meshes of all frames, with `points` and `faces`."""
    draco = import_module("DracoPy")
    return [draco.decode(frame) for frame in unpack_frames(data)]


def _encode(vertices: Vertices, faces: Faces, **options: Any) -> bytes:
    return bytes(
        import_module("DracoPy").encode(
            vertices.astype(np.float32), faces.astype(np.uint32),
            compression_level=LEVEL, create_metadata=False, **options,
        )
    )  # fmt: skip


def prepare(sequence: MeshSequence) -> MeshSequence:
    """The sequence in float32 with distinct positions.

    Draco merges equal positions, which would change the mesh from frame to frame.
    """
    frames = [separate_equal(frame) for frame in sequence.vertices.astype(np.float32)]
    return MeshSequence(np.stack(frames), sequence.faces, sequence.fps, sequence.name)


def encode(sequence: MeshSequence, bits: float) -> bytes:
    """The streams of all frames; each contains the connectivity."""
    return encode_frames(((vertices, sequence.faces) for vertices in sequence.vertices), bits)


def decode(data: bytes, _shape: Shape, _dtype: npt.DTypeLike) -> Vertices:
    """Positions in Draco's order, which may repeat a vertex."""
    frames = [np.asarray(mesh.points) for mesh in decode_frames(data)]
    if len({frame.shape for frame in frames}) != 1:
        raise InvalidInputError("Draco gives frames of different vertex counts")
    return np.stack(frames).astype(np.float32)


def restore(decoded: Vertices, prepared: MeshSequence, bits: float) -> Vertices:
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
    original, vertices = prepared.vertices, np.empty_like(prepared.vertices)
    vertices[:, vertex_of_point] = decoded
    step = np.ptp(original.astype(np.float64), axis=1).max(axis=1) / (2 ** int(bits) - 1)
    slack = 8 * np.finfo(np.float32).eps * np.abs(original).max()
    distance = np.abs(vertices.astype(np.float64) - original).max(axis=(1, 2))
    if (distance > 0.501 * step + slack).any():  # more than rounding explains: another order
        raise InvalidInputError(
            "Draco orders the vertices of the frames differently from numbered ones: cannot match "
            "positions to vertices"
        )
    return vertices


def draco_order(sequence: MeshSequence) -> Integers:
    """Return the vertex of each point of a decoded frame, shape (P,).

    Draco's order follows from the faces alone, so it can be read from a stream in which the
    position of each vertex is its number.
    """
    bits = max((sequence.n_verts - 1).bit_length(), 1)
    numbered = np.zeros((sequence.n_verts, 3), np.float32)
    numbered[:, 0] = np.arange(sequence.n_verts)
    stream = _encode(
        numbered,
        sequence.faces,
        quantization_bits=bits,
        quantization_range=float((1 << bits) - 1),
        quantization_origin=[0, 0, 0],
    )
    points = np.asarray(import_module("DracoPy").decode(stream).points)
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


DRACO = Peer(
    name="draco",
    summary=f"Draco, level {LEVEL}, each frame for itself with its connectivity",
    package=Extra("peers", "DracoPy", "DracoPy"),
    encode=encode,
    decode=decode,
    settings=(8, 9, 10, 11, 12),
    quick=(9, 11),
    params="qp {:g}",
    prepare=prepare,
    restore=restore,
    has_faces=True,
)
"""Its settings are bits per coordinate in the bounding box of a frame."""
