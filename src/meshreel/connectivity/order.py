"""Coder of the given order of vertices and faces, for a mesh that is known without it.

There are two ways, and the shorter is kept. Vertices first: their numbers are predicted from the
mesh, and faces are located in the list sorted by these numbers. Faces first: they are located in
the list of the connectivity coder, and vertex numbers are predicted from the order in which the
faces first use the vertices, which is how many programs number them.
"""

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.face_order import decode_face_order, encode_face_order, list_faces
from meshreel.connectivity.triangles import AnyFaces, lowest_rotation, sorted_order
from meshreel.connectivity.vertex_order import (
    decode_numbering,
    encode_numbering,
    inverse_permutation,
)
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError
from meshreel.runtime.threads import in_threads
from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]

VERTICES_ONLY, VERTICES_FIRST, FACES_FIRST = range(3)


def encode_order(
    faces: Faces, internal_faces: AnyFaces, internal_to_given: Integers, keep_faces: bool
) -> bytes:
    """Bytes of the permutation from the internal order to the given one.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
        As given.
    internal_faces : integer array of shape (M, 3)
        The same oriented triangles in any order, in internal vertices.
    internal_to_given : int64 array of shape (V,)
    keep_faces : bool
        False to keep the order of the vertices only.
    """
    prediction, numbering = encode_numbering(internal_to_given, internal_faces)
    if not keep_faces:
        return _join(VERTICES_ONLY, prediction, numbering, b"")
    n_verts = len(internal_to_given)
    coded: dict[int, bytes] = {}

    def vertices_first() -> bytes:
        sorted_faces, corners = _sorted_corners(faces, n_verts)
        listing = encode_face_order(corners, sorted_faces, n_verts)
        return _join(VERTICES_FIRST, prediction, numbering, listing)

    def faces_first() -> bytes:
        named = inverse_permutation(internal_to_given)[faces]
        naming = naming_order(named, n_verts)
        corners = _matching_corners(named, internal_faces, n_verts)
        return _join(
            FACES_FIRST,
            *encode_numbering(internal_to_given[naming], inverse_permutation(naming)[named]),
            encode_face_order(corners, internal_faces, n_verts),
        )

    ways = (vertices_first, faces_first)
    in_threads(lambda way: coded.update({way: ways[way]()}), range(len(ways)))
    return min((coded[way] for way in range(len(ways))), key=len)


def decode_given_order(
    order_payload: bytes, internal_faces: AnyFaces, n_verts: int
) -> tuple[Integers, Integers]:
    """Given number of each internal vertex, and the faces in given numbers.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an order of this mesh.
    """
    kind, prediction, numbering, listing = _split(order_payload)
    if kind == FACES_FIRST:
        corners = decode_face_order(listing, internal_faces, n_verts)
        named = list_faces(internal_faces, corners)
        naming = naming_order(named, n_verts)
        numbers = decode_numbering(
            numbering, prediction, inverse_permutation(naming)[named], n_verts
        )
        internal_to_given = numbers[inverse_permutation(naming)]
        return internal_to_given, internal_to_given[named]
    internal_to_given = decode_numbering(numbering, prediction, internal_faces, n_verts)
    given = internal_to_given[internal_faces]
    if kind == VERTICES_ONLY:
        if listing:
            raise CorruptStreamError("there are faces in an order of vertices only")
        return internal_to_given, given
    lowest, _ = lowest_rotation(given, n_verts)
    sorted_faces = lowest[sorted_order(lowest, n_verts)]
    return internal_to_given, list_faces(
        sorted_faces, decode_face_order(listing, sorted_faces, n_verts)
    )


def naming_order(faces: AnyFaces, n_verts: int) -> Integers:
    """All vertices in the order of their first use by faces; then unused ones, ascending."""
    named, first = np.unique(faces, return_index=True)
    rest = np.ones(n_verts, bool)
    rest[named] = False
    return np.concatenate([named[np.argsort(first)], np.flatnonzero(rest)]).astype(np.int64)


def _sorted_corners(faces: AnyFaces, n_verts: int) -> tuple[Integers, Integers]:
    """The sorted list of the triangles, and the first corner of each given face in it."""
    lowest, front = lowest_rotation(faces, n_verts)
    order = sorted_order(lowest, n_verts)
    return lowest[order], 3 * inverse_permutation(order) + (-front) % 3


def _matching_corners(faces: AnyFaces, known: AnyFaces, n_verts: int) -> Integers:
    """The first corner of each face in a list of the same triangles in another order."""
    lowest, front = lowest_rotation(faces, n_verts)
    known_lowest, known_front = lowest_rotation(known, n_verts)
    corners = np.empty(len(lowest), np.int64)
    known_order = sorted_order(known_lowest, n_verts)
    order = sorted_order(lowest, n_verts)
    corners[order] = 3 * known_order + (known_front[known_order] - front[order]) % 3
    return corners


def _join(kind: int, prediction: int, numbering: bytes, listing: bytes) -> bytes:
    return bytes([kind, prediction]) + write_varint(len(numbering)) + numbering + listing


def _split(order_payload: bytes) -> tuple[int, int, bytes, bytes]:
    if len(order_payload) < 2 or order_payload[0] > FACES_FIRST:
        raise CorruptStreamError("the order is of an unknown kind")
    size, start = read_varint(order_payload, 2)
    if size > len(order_payload) - start:
        raise CorruptStreamError(f"the vertex order needs {size} bytes; they are missing")
    end = start + size
    return order_payload[0], order_payload[1], order_payload[start:end], order_payload[end:]
