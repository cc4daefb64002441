"""Faces in the order of a traversal of the surface: a Draco surface and the faces that it lacks.

Draco takes each oriented triangle once, needs three different corners, has no unused vertices and
splits vertices where the surface is not a manifold. So degenerate and repeated faces are listed
separately, unused vertices are numbered last, and points that are copies of a vertex are listed
with the point that they copy.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.draco import decode_surface, encode_surface
from meshreel.connectivity.general import N_ROWS, face_differences, join_differences
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.connectivity.triangles import (
    AnyFaces,
    lowest_rotation,
    repeats_before,
    sorted_order,
)
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError
from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Traversal:
    """A face list in traversal order.

    Attributes
    ----------
    coding : int
        Coding of the symbols of the surface, `STANDARD` or `VALENCE`.
    body : bytes
        The bytes that `decode_traversal` reads.
    internal_to_given : int64 array of shape (V,)
    internal_faces : int32 array of shape (M, 3)
    """

    coding: int
    body: bytes
    internal_to_given: Integers
    internal_faces: Faces


def encode_traversal(faces: Faces, n_verts: int) -> Traversal | None:
    """The faces in traversal order; None where that would not preserve the triangles."""
    apart = (faces == np.roll(faces, 1, axis=1)).any(axis=1) | repeats_before(faces, n_verts)
    used, compact = np.unique(faces[~apart], return_inverse=True)
    surface = encode_surface(compact.reshape(-1, 3).astype(np.int64), len(used))
    if surface is None:
        return None
    first_point = np.full(len(used), len(surface.vertex_of_point), np.int64)
    points = np.arange(len(surface.vertex_of_point))
    np.minimum.at(first_point, surface.vertex_of_point, points)
    same_as = first_point[surface.vertex_of_point]
    again = np.flatnonzero(same_as != points)
    internal_to_given = _complete(used[surface.vertex_of_point[same_as == points]], n_verts)
    extra = inverse_permutation(internal_to_given)[faces[apart]]
    internal_faces = _assemble(surface.faces, again, same_as[again], extra)
    if not _same_triangles(internal_to_given[internal_faces], faces, n_verts):
        return None
    n_unused = n_verts - len(used)
    described = _write_irregular(again, same_as[again], extra)
    body = b"".join(
        [
            *map(write_varint, (n_unused, len(again), len(extra), len(described))),
            described,
            surface.connectivity,
        ]
    )
    return Traversal(surface.coding, body, internal_to_given, internal_faces)


def decode_traversal(body: bytes, coding: int, n_verts: int, n_faces: int) -> Faces:
    """The internal faces of `encode_traversal`.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of `n_faces` faces on `n_verts` vertices.
    """
    n_unused, position = read_varint(body, 0)
    n_again, position = read_varint(body, position)
    n_extra, position = read_varint(body, position)
    size, position = read_varint(body, position)
    n_points = n_verts - n_unused + n_again
    if n_unused > n_verts or n_extra > n_faces or n_points > 3 * (n_faces - n_extra):
        raise CorruptStreamError(
            f"{n_unused} unused vertices, {n_again} split ones and {n_extra} faces apart are too "
            f"many for {n_verts} vertices and {n_faces} faces"
        )
    if n_again > n_points or size > len(body) - position:
        raise CorruptStreamError(f"{n_again} of {n_points} points in {size} bytes are impossible")
    again, same_as, extra = _read_irregular(
        body[position : position + size], n_again, n_extra, n_points, n_verts
    )
    faces = decode_surface(body[position + size :], coding, n_points, n_faces - n_extra)
    return _assemble(faces, again, same_as, extra)


def _complete(named: Integers, n_verts: int) -> Integers:
    """The vertices named, then all others, ascending."""
    others = np.ones(n_verts, bool)
    others[named] = False
    return np.concatenate([named, np.flatnonzero(others)]).astype(np.int64)


def _assemble(faces: Integers, again: Integers, same_as: Integers, extra: AnyFaces) -> Faces:
    """Faces of points as faces of vertices: points that are no copies are the vertices."""
    n_points = int(faces.max()) + 1
    is_first = np.ones(n_points, bool)
    is_first[again] = False
    vertex = np.cumsum(is_first) - 1
    vertex[again] = vertex[same_as]
    return np.concatenate([vertex[faces], extra]).astype(np.int32)


def _same_triangles(faces: AnyFaces, others: AnyFaces, n_verts: int) -> bool:
    lowest, _ = lowest_rotation(faces, n_verts)
    others_lowest, _ = lowest_rotation(others, n_verts)
    return np.array_equal(
        lowest[sorted_order(lowest, n_verts)], others_lowest[sorted_order(others_lowest, n_verts)]
    )


def _write_irregular(again: Integers, same_as: Integers, extra: AnyFaces) -> bytes:
    if not len(again) and not len(extra):
        return b""
    return encode_integers([np.diff(again, prepend=0), again - same_as, *face_differences(extra)])


def _read_irregular(
    data: bytes, n_again: int, n_extra: int, n_points: int, n_verts: int
) -> tuple[Integers, Integers, Faces]:
    if not n_again and not n_extra:
        if data:
            raise CorruptStreamError("bytes describe irregular vertices; there are none")
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3), np.int32)
    gaps, back, *rows = decode_integers(data, [n_again, n_again] + [n_extra] * N_ROWS)
    again = np.cumsum(gaps)
    same_as = again - back
    is_again = np.zeros(n_points, bool)
    if n_again:
        if gaps[1:].min(initial=1) < 1 or again[0] < 1 or again[-1] >= n_points:
            raise CorruptStreamError("the split points are not ascending")
        is_again[again] = True
        if back.min() < 1 or same_as.min() < 0 or is_again[same_as].any():
            raise CorruptStreamError("a split point copies none before it")
    return again, same_as, join_differences(rows, n_verts)
