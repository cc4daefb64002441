"""Adjacency matrix, neighbors and components of any triangle list.

Loops of degenerate faces and repeated edges are left out, as in `model.geometry.connectivity`.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from meshreel.arrays import Integers
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces


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
