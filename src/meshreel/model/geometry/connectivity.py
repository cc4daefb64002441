"""Edges, adjacency, components and boundary of any triangle list.

A degenerate face (with a repeated vertex) contributes its edges between different vertices;
duplicate faces contribute their edges once; a vertex without an edge is isolated.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from meshreel.arrays import Integers
from meshreel.model.sequence import Faces


def undirected_edges(faces: Faces) -> Integers:
    """Unique edges, of shape (E, 2), lower vertex first, sorted."""
    return _edges_and_face_counts(faces)[0]


def adjacency_matrix(faces: Faces, n_verts: int) -> csr_array:
    """Binary adjacency C of shape (V, V) in float64 (paper Eq. 2)."""
    edges = undirected_edges(faces)
    rows = np.concatenate([edges[:, 0], edges[:, 1]])
    columns = np.concatenate([edges[:, 1], edges[:, 0]])
    return csr_array((np.ones(len(rows)), (rows, columns)), shape=(n_verts, n_verts))


def neighbors_of(
    adjacency: csr_array, vertices: npt.NDArray[np.integer]
) -> tuple[npt.NDArray[np.integer], npt.NDArray[np.integer]]:
    """Number of neighbors of each given vertex, and their concatenated neighbors.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Its values are ignored.
    vertices : integer array
        May contain duplicates.
    """
    starts, ends = adjacency.indptr[vertices], adjacency.indptr[vertices + 1]
    counts = ends - starts
    last = np.cumsum(counts, dtype=counts.dtype)
    positions = np.arange(last[-1:].sum(), dtype=counts.dtype) + np.repeat(ends - last, counts)
    return counts, adjacency.indices[positions]


def component_labels(faces: Faces, n_verts: int) -> tuple[int, Integers]:
    """Number of connected components, and the component of each vertex.

    Components are numbered by their lowest vertex; an isolated vertex is a component.
    """
    n_components, labels = connected_components(adjacency_matrix(faces, n_verts), directed=False)
    return int(n_components), labels.astype(np.int64)


def isolated_vertices(faces: Faces, n_verts: int) -> Integers:
    """Vertices without an edge, ascending."""
    has_edge = np.zeros(n_verts, bool)
    for corner in range(3):
        differs = (faces[:, corner, None] != faces).any(axis=1)
        has_edge[faces[differs, corner]] = True
    return np.flatnonzero(~has_edge)


def boundary_edges(faces: Faces) -> Integers:
    """Edges that belong to exactly one face, of shape (B, 2)."""
    edges, counts = _edges_and_face_counts(faces)
    return np.asarray(edges[counts == 1], np.int64)


def _edges_and_face_counts(faces: Faces) -> tuple[Integers, Integers]:
    """Sorted edges of shape (E, 2), and the number of face sides on each."""
    starts = faces.astype(np.int64).ravel()
    ends = np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    # One key per edge: sorting keys is many times faster than sorting pairs.
    size = high.max(initial=0) + 1
    keys, counts = np.unique((low * size + high)[low != high], return_counts=True)
    return np.stack([keys // size, keys % size], axis=1), counts
