"""NMSVE: position error and smoothness error of each frame, in equal parts."""

import math

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from meshreel.geometry.connectivity import undirected_edges
from meshreel.metrics.reference import (
    bounding_box_reference,
    paired_frames,
    shared_reference,
    sum_of_squares,
)
from meshreel.sequence import Faces, Vertices

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@np.errstate(over="ignore", invalid="ignore")
def nmsve_per_frame(original: Vertices, decoded: Vertices, faces: Faces) -> Floats:
    """NMSVE of every frame, ``(||V - V^||_F + ||GL(V) - GL(V^)||_F) / (2 n)``.

    ``GL(v_i) = v_i - (sum_j v_j / l_ij) / (sum_j 1 / l_ij)`` over the 1-ring, with the edge
    lengths of the mesh it is applied to. An isolated vertex has GL = 0, and so has one that
    coincides with a neighbour: the limit of the formula as that edge shrinks, so that the
    measure does not jump when rounding merges or parts two vertices.

    Coordinates are divided by the bounding-box diagonal of frame 0 of the original (of all its
    frames where frame 0 is a single point). This normalisation is our choice; the paper gives
    none. Where there is no diagonal at all, a frame has 0 if it is identical, else infinity.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite
    faces : integer array of shape (M, 3)

    Returns
    -------
    float64 array of shape (T,), without unit

    Raises
    ------
    InvalidInputError
        If the shapes differ.

    Source: after Karni and Gotsman, "Spectral compression of mesh geometry", SIGGRAPH 2000.
    """
    reference = shared_reference(original, decoded)
    edges = undirected_edges(faces)
    incidence = _signed_incidence(edges, original.shape[1])
    errors = [
        math.sqrt(sum_of_squares(displacement))
        + math.sqrt(
            sum_of_squares(
                _geometric_laplacian(frame, edges, incidence)
                - _geometric_laplacian(frame + displacement, edges, incidence)
            )
        )
        for frame, displacement in paired_frames(original, decoded, reference)
    ]
    start = bounding_box_reference(original[0])
    diagonal = start.diagonal_scaled / start.scale * reference.scale or reference.diagonal_scaled
    sums = np.nan_to_num(np.array(errors), nan=np.inf, posinf=np.inf)
    without_size = np.where(sums > 0, np.inf, 0)
    size = 2 * original.shape[1] * diagonal
    return np.asarray(np.divide(sums, size, out=without_size, where=size > 0))


def _signed_incidence(edges: Integers, n_verts: int) -> csr_array:
    """Matrix (V, E) of +1 where an edge starts and -1 where it ends."""
    ids = np.arange(len(edges))
    signs = np.repeat([1.0, -1.0], len(edges))
    places = (edges.T.ravel(), np.tile(ids, 2))
    return coo_array((signs, places), shape=(n_verts, len(edges))).tocsr()


def _geometric_laplacian(frame: Floats, edges: Integers, incidence: csr_array) -> Floats:
    """GL of every vertex, as ``(sum_j (v_i - v_j) / l_ij) / (sum_j 1 / l_ij)``, shape (V, 3)."""
    back = frame[edges[:, 0]] - frame[edges[:, 1]]
    lengths = np.sqrt(np.einsum("ea,ea->e", back, back))
    present = lengths > 0
    inverse = np.divide(1.0, lengths, out=np.full_like(lengths, np.inf), where=present)
    unit = np.divide(back, lengths[:, None], out=np.zeros_like(back), where=present[:, None])
    weights = abs(incidence) @ inverse
    sums = incidence @ unit
    weights = weights[:, None]
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0))
