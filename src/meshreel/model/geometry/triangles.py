"""Triangles up to rotation: one representative of each, and sorted lists of them."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers

AnyFaces = npt.NDArray[np.int32] | npt.NDArray[np.int64]

CORNERS, NEXT = np.arange(3), [1, 2, 0]


def rotate_corners(faces: AnyFaces, first: Integers) -> Integers:
    """Rotate each face so that its corner number `first` (0..2) comes first; returns int64."""
    corners = (first[:, None] + CORNERS) % 3
    return np.take_along_axis(np.asarray(faces, np.int64), corners, axis=1)


def lowest_rotation(faces: AnyFaces, n_verts: int) -> tuple[Integers, Integers]:
    """Rotate each face to be lexicographically lowest; also return the corner that becomes first.

    Two faces are the same oriented triangle if and only if these representatives are equal.
    """
    wide = np.asarray(faces, np.int64)
    first = np.argmin(wide * n_verts + wide[:, NEXT], axis=1).astype(np.int64)
    return rotate_corners(wide, first), first


def sorted_order(lowest: Integers, n_verts: int) -> Integers:
    """Indices that sort representatives lexicographically; the sort is stable."""
    return np.lexsort((lowest[:, 2], lowest[:, 0] * n_verts + lowest[:, 1])).astype(np.int64)


def matching_corners(faces: AnyFaces, known: AnyFaces, n_verts: int) -> Integers:
    """Find the first corner of each face in a list of the same triangles in another order."""
    lowest, first = lowest_rotation(faces, n_verts)
    known_lowest, known_first = lowest_rotation(known, n_verts)
    corners = np.empty(len(lowest), np.int64)
    known_order = sorted_order(known_lowest, n_verts)
    face_order = sorted_order(lowest, n_verts)
    corners[face_order] = 3 * known_order + (known_first[known_order] - first[face_order]) % 3
    return corners
