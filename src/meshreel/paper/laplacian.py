"""Adjacency and Laplacian matrices of a mesh, its components, and delta coordinates.

Loops of degenerate faces and repeated edges are left out, as in `model.geometry.connectivity`.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from meshreel.arrays import Floats, Integers
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces
from meshreel.runtime.threads import chunks, in_threads

RELATIVE_RIDGE = 1e-3
"""Ridge of reproducing weights, as a fraction of the neighbors' mean squared distance."""

CHUNK_VERTICES = 1024
"""Number of vertices whose weights are computed at once."""

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


def component_labels(faces: Faces, n_verts: int) -> tuple[int, Integers]:
    """Number of connected components, and the component of each vertex.

    Components are numbered by their lowest vertex; an isolated vertex is a component.
    """
    n_components, labels = connected_components(adjacency_matrix(faces, n_verts), directed=False)
    return int(n_components), labels.astype(np.int64)


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


def reproducing_laplacian(adjacency: csr_array, fields: Floats, noise: float) -> csr_array:
    """Laplacian ``I - W`` whose weights reproduce known fields on the mesh.

    The weights of a vertex sum to 1 and approximate its value in every field by the weighted mean
    of its neighbors' values, in the least-squares sense. Fields that vary over the mesh like the
    known ones then have small deltas for any sampling of the mesh: deltas of uniform weights
    contain the sampling, and those of cotangent weights, which come from one frame, contain the
    bending.

    Weights that fit noise in the fields would propagate it; a ridge keeps them nearly equal where
    the fields do not determine them.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Binary, symmetric, with an empty diagonal.
    fields : float64 array of shape (V, K)
        Without columns, all weights of a vertex are equal: the normalized uniform Laplacian.
    noise : float
        Variance of the noise in each field, times the strength of the ridge.

    Returns
    -------
    csr_array of shape (V, V); rows sum to zero, and are empty for isolated vertices.

    References
    ----------
    S. T. Roweis, L. K. Saul, "Nonlinear dimensionality reduction by locally linear embedding",
    Science 290, 2000: the weights of its first step.
    """
    degrees = np.diff(adjacency.indptr)
    weights = np.zeros(len(adjacency.indices))

    def fill(vertices: npt.NDArray[np.int64]) -> None:
        entries = adjacency.indptr[vertices][:, None] + np.arange(degrees[vertices[0]])
        offsets = fields[adjacency.indices[entries]] - fields[vertices][:, None, :]
        weights[entries] = _reproducing_weights(offsets, noise)

    in_threads(fill, _by_degree(degrees))
    mean = csr_array((weights, adjacency.indices, adjacency.indptr), shape=adjacency.shape)
    return csr_array(diags_array((degrees > 0).astype(np.float64)) - mean)


def _by_degree(degrees: npt.NDArray[np.integer]) -> list[npt.NDArray[np.int64]]:
    """Vertices with neighbors, in groups of equal degree."""
    pieces = []
    for degree in np.unique(degrees[degrees > 0]):
        vertices = np.flatnonzero(degrees == degree)
        pieces += [vertices[piece] for piece in chunks(len(vertices), CHUNK_VERTICES)]
    return pieces


def _reproducing_weights(offsets: Floats, noise: float) -> Floats:
    """Weights of shape (N, d) for offsets of d neighbors, of shape (N, d, K).

    They are (Z Z^T + r I)^-1 1 up to a factor, computed from a K by K system (Woodbury), because a
    vertex can have any number of neighbors.
    """
    n_neighbors, n_fields = offsets.shape[1:]
    spread = np.einsum("ijk,ijk->i", offsets, offsets) / n_neighbors
    ridge = RELATIVE_RIDGE * spread + noise * n_fields
    ridge = np.where(ridge > 0, ridge, 1.0)
    inner = np.swapaxes(offsets, 1, 2) @ offsets + ridge[:, None, None] * np.eye(n_fields)
    solved = np.linalg.solve(inner, offsets.sum(axis=1)[:, :, None])
    weights = 1.0 - (offsets @ solved)[:, :, 0]
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
