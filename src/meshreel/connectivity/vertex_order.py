"""Coder of a numbering of the vertices of a known mesh.

The numbers are predicted in one of three ways, whichever takes the fewest bytes: along the mesh
(a vertex has a number near those of its neighbours), along the numbering (consecutive vertices
are near each other), or not at all.
"""

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.triangles import AnyFaces
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]

UNPREDICTED, ALONG_MESH, CONSECUTIVE = range(3)
PREDICTIONS = (ALONG_MESH, CONSECUTIVE, UNPREDICTED)


def encode_numbering(numbers: Integers, faces: AnyFaces) -> tuple[int, bytes]:
    """The best kind of prediction, and the bytes.

    Parameters
    ----------
    numbers : int64 array of shape (V,)
        A permutation of 0..V-1: the number of each vertex.
    faces : integer array of shape (M, 3)
        The mesh, with vertices named by their index in `numbers`.
    """
    coded = [encode_integers([_residuals(numbers, faces, kind)]) for kind in PREDICTIONS]
    best = min(range(len(coded)), key=lambda k: len(coded[k]))
    return PREDICTIONS[best], coded[best]


def decode_numbering(data: bytes, prediction: int, faces: AnyFaces, n_verts: int) -> Integers:
    """The numbers that `encode_numbering` wrote.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of a permutation.
    """
    (row,) = decode_integers(data, [n_verts])
    if prediction == UNPREDICTED:
        return require_permutation(row + n_verts // 2, "vertex")
    if prediction == ALONG_MESH:
        return require_permutation(_sum_to_roots(row, mesh_parents(faces, n_verts)), "vertex")
    if prediction == CONSECUTIVE:
        return inverse_permutation(require_permutation(np.cumsum(row), "vertex"))
    raise CorruptStreamError(f"vertex prediction {prediction} is unknown; 0..2 are allowed")


def mesh_parents(faces: AnyFaces, n_verts: int) -> Integers:
    """The parent of each vertex: its highest lower neighbour, or else the vertex before it.

    Vertex 0 has the parent `n_verts`, which is no vertex: the root.
    """
    wide = np.asarray(faces, np.int64)
    parents = np.arange(-1, n_verts - 1, dtype=np.int64)
    lower = np.full(n_verts, -1, np.int64)
    for ends in (wide[:, [0, 1]], wide[:, [1, 2]], wide[:, [2, 0]]):
        low, high = ends.min(axis=1), ends.max(axis=1)
        proper = low < high
        np.maximum.at(lower, high[proper], low[proper])
    parents = np.where(lower >= 0, lower, parents)
    parents[:1] = n_verts
    return parents


def inverse_permutation(order: Integers) -> Integers:
    """The index of each of 0..n-1 in `order`."""
    inverse = np.empty(len(order), np.int64)
    inverse[order] = np.arange(len(order))
    return inverse


def require_permutation(order: Integers, what: str) -> Integers:
    """The order itself if it holds each of 0..n-1 once.

    Raises
    ------
    CorruptStreamError
        Otherwise.
    """
    n = len(order)
    if n and (order.min() < 0 or order.max() >= n or np.bincount(order, minlength=n).max() > 1):
        raise CorruptStreamError(f"the {what} order is no permutation of 0..{n - 1}")
    return order


def _residuals(numbers: Integers, faces: AnyFaces, prediction: int) -> Integers:
    if prediction == UNPREDICTED:
        return numbers - len(numbers) // 2
    if prediction == ALONG_MESH:
        above: Integers = np.append(numbers, 0)[mesh_parents(faces, len(numbers))]
        return numbers - above
    return np.diff(inverse_permutation(numbers), prepend=0)


def _sum_to_roots(values: Integers, parents: Integers) -> Integers:
    """Sum of each node's value and those of all its ancestors, by pointer doubling."""
    root = len(values)
    total, above = np.append(values, 0), np.append(parents, root)
    while (above != root).any():
        total += total[above]
        above = above[above]
    return total[:root]
