"""Adjacency and Laplacian matrices of a mesh, and delta coordinates.

Self-loops of degenerate faces and repeated edges are omitted, as in `model.geometry.connectivity`.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, diags_array

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces

MIN_COTANGENT_WEIGHT, MAX_COTANGENT_WEIGHT = 0.05, 20.0
"""Bounds of a cotangent weight: obtuse triangles make it negative, and slivers huge."""


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


def uniform_laplacian(faces: Faces, n_verts: int, *, normalized: bool = False) -> csr_array:
    """Uniform Laplacian, ``L = D - C`` with binary adjacency C (paper Eq. 1).

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
        Number of vertices, V.
    normalized : bool, default False
        Divide each row by the vertex's degree: ``L = I - D^-1 C``, whose deltas are those of
        paper Eq. 3. The paper calls both L; they differ wherever degrees do.

    Returns
    -------
    csr_array of shape (V, V), float64; rows sum to zero, and are empty for isolated vertices.
    """
    adjacency = adjacency_matrix(faces, n_verts)
    degrees = adjacency.sum(axis=1)
    laplacian = csr_array(diags_array(degrees) - adjacency)
    if not normalized:
        return laplacian
    inverse = np.divide(1.0, degrees, out=np.zeros_like(degrees), where=degrees > 0)
    return csr_array(diags_array(inverse) @ laplacian)


def cotangent_laplacian(faces: Faces, shape: npt.NDArray[np.floating]) -> csr_array:
    """Cotangent Laplacian with rows of unit weight, ``L = I - D^-1 W``.

    The weight of an edge is half the sum of the cotangents of its opposite angles, clamped to
    0.05..20. Degenerate faces do not contribute.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    shape : float array of shape (V, 3)
        The positions that determine the angles.

    Returns
    -------
    csr_array of shape (V, V), float64; rows sum to zero, and are empty for isolated vertices.

    References
    ----------
    U. Pinkall, K. Polthier, "Computing discrete minimal surfaces and their conjugates", 1993.
    """
    n_verts = len(shape)
    adjacency = adjacency_matrix(faces, n_verts)
    rows, columns, halves = [], [], []
    for corner in range(3):
        apex, start, end = (faces[:, (corner + k) % 3] for k in range(3))
        to_start, to_end = (shape[tip].astype(np.float64) - shape[apex] for tip in (start, end))
        area = np.linalg.norm(np.cross(to_start, to_end), axis=1)
        dot = np.einsum("ij,ij->i", to_start, to_end)
        rows.append(start)
        columns.append(end)
        halves.append(np.divide(dot, 2 * area, out=np.zeros_like(dot), where=area > 0))
    entries = np.concatenate(halves), (np.concatenate(rows), np.concatenate(columns))
    one_sided = csr_array(entries, shape=(n_verts, n_verts))
    symmetric = csr_array(one_sided + one_sided.T).multiply(adjacency).tocsr()
    weights = csr_array(adjacency)
    row_indices = np.repeat(np.arange(n_verts), np.diff(weights.indptr))
    cotangents = np.asarray(symmetric[row_indices, weights.indices]).ravel()
    weights.data = np.clip(cotangents, MIN_COTANGENT_WEIGHT, MAX_COTANGENT_WEIGHT)
    sums = weights.sum(axis=1)
    inverse = np.divide(1.0, sums, out=np.zeros_like(sums), where=sums > 0)
    return csr_array(diags_array((sums > 0).astype(np.float64)) - diags_array(inverse) @ weights)


def delta_coordinates(laplacian: csr_array, columns: npt.NDArray[np.floating]) -> Floats:
    """Differential coordinates of every column, ``delta = L V`` (paper Eq. 4, paper Eq. 8).

    The Laplacian acts on vertices and the projection on frames, so the two commute: the deltas
    of projected trajectories are the projected deltas, for K columns instead of T.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
    columns : float array of shape (V, K)
        A function on the vertices in each column, such as one coordinate of one frame.

    Returns
    -------
    float64 array of shape (V, K), in the units of the columns; unchanged by translation.

    Raises
    ------
    InvalidInputError
        If V differs between the two arguments.
    """
    if columns.shape[0] != laplacian.shape[1]:
        raise InvalidInputError(
            f"the Laplacian has {laplacian.shape[1]} vertices; got {columns.shape[0]} rows"
        )
    return np.asarray(laplacian @ np.asarray(columns, np.float64))
