"""Coding of the given order of vertices and faces of a mesh in internal order."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel import order
from meshreel.model.geometry.triangles import AnyFaces, matching_corners
from meshreel.model.sequence import Faces

VERTICES_ONLY, VERTICES_AND_FACES = 1, 2
"""First byte: which orders are stored."""


def inverse_permutation(order: npt.NDArray[np.integer]) -> Integers:
    """Return the index of each of 0..n-1 in a permutation."""
    inverse = np.empty(len(order), np.int64)
    inverse[order] = np.arange(len(order))
    return inverse


def encode_order(
    faces: Faces, internal_faces: AnyFaces, internal_to_given: Integers, keep_faces: bool
) -> bytes:
    """Encode the permutation from the internal order to the given one.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
        In the given order.
    internal_faces : integer array of shape (M, 3)
        The same oriented triangles in any order, in internal vertices.
    internal_to_given : int64 array of shape (V,)
    keep_faces : bool
        False to keep the order of the vertices only.
    """
    n_verts = len(internal_to_given)
    sequence = inverse_permutation(internal_to_given)
    if not keep_faces:
        return bytes([VERTICES_ONLY]) + order.encode_order(internal_faces, None, sequence)
    corners = matching_corners(sequence[faces], internal_faces, n_verts)
    coded = order.encode_order(internal_faces, corners, sequence)
    return bytes([VERTICES_AND_FACES]) + coded
