"""Edges, adjacency, components and boundary of a triangle list, however irregular it is.

Degenerate faces (a vertex named twice) contribute the edges that are left of them; duplicate
faces contribute their edges once; a vertex that no edge touches is isolated.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]


def undirected_edges(faces: Faces) -> Integers:
    """Every edge once, as an array of shape (E, 2) with ends ascending, sorted."""
    pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    pairs.sort(axis=1)
    return np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)


def adjacency_matrix(faces: Faces, n_verts: int) -> csr_array:
    """Binary adjacency C of shape (V, V) in float64 (paper Eq. 2)."""
    edges = undirected_edges(faces)
    rows = np.concatenate([edges[:, 0], edges[:, 1]])
    columns = np.concatenate([edges[:, 1], edges[:, 0]])
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=(n_verts, n_verts))


def component_labels(faces: Faces, n_verts: int) -> tuple[int, Integers]:
    """Number of connected components, and the component of each vertex.

    Components are numbered by their lowest vertex; an isolated vertex is one of its own.
    """
    n_components, labels = connected_components(adjacency_matrix(faces, n_verts), directed=False)
    return int(n_components), labels.astype(np.int64)


def isolated_vertices(faces: Faces, n_verts: int) -> Integers:
    """Vertices that no edge touches, ascending."""
    touched = np.zeros(n_verts, bool)
    touched[undirected_edges(faces)] = True
    return np.flatnonzero(~touched)


def boundary_edges(faces: Faces) -> Integers:
    """Edges that belong to exactly one face, as an array of shape (B, 2)."""
    pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    pairs.sort(axis=1)
    edges, counts = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0, return_counts=True)
    return np.asarray(edges[counts == 1], np.int64)
