"""NMSVE: position error plus smoothness error of each frame, with equal weights."""

import math

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.metrics.frame_sums import sum_of_squares
from meshreel.metrics.reference import (
    Reference,
    bounding_box_reference,
    paired_frames,
    relative,
    shared_reference,
)
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces, Vertices


@np.errstate(over="ignore", invalid="ignore")
def nmsve_per_frame(original: Vertices, decoded: Vertices, faces: Faces) -> Floats:
    """NMSVE of every frame, ``(||V - V^||_F + ||GL(V) - GL(V^)||_F) / (2 n)``.

    ``GL(v_i) = v_i - (sum_j v_j / l_ij) / (sum_j 1 / l_ij)`` over the 1-ring, with the edge
    lengths of the mesh it is applied to. GL = 0 for an isolated vertex and for one that coincides
    with a neighbor: the limit of the formula as that edge shrinks, so that the error does not jump
    when rounding merges or separates two vertices.

    Coordinates are divided by the bounding-box diagonal of frame 0 of the original (of all its
    frames if frame 0 is a single point). This normalization is our choice; the paper gives none.
    Without any extent, an identical frame has error 0 and every other frame infinity.

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
    nmsve = FrameNmsve(original[0], faces, reference)
    return np.array([nmsve.of(*pair) for pair in paired_frames(original, decoded, reference)])


class FrameNmsve:
    """NMSVE of single frames, as defined by `nmsve_per_frame`.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Frame 0 of the original, in model units.
    faces : integer array of shape (M, 3)
    reference : Reference
        Of the whole original.
    """

    def __init__(self, first: npt.NDArray[np.floating], faces: Faces, reference: Reference) -> None:
        self._edges = np.ascontiguousarray(undirected_edges(faces).T)
        start = bounding_box_reference(first)
        diagonal = start.diagonal_scaled / start.scale * reference.scale
        self._size = 2 * len(first) * (diagonal or reference.diagonal_scaled)

    @np.errstate(over="ignore", invalid="ignore")
    def of(self, frame: Floats, displacement: Floats) -> float:
        """NMSVE of one pair from `paired_frames` with the same reference."""
        laplacian = self._laplacian(frame) - self._laplacian(frame + displacement)
        error = math.sqrt(sum_of_squares(displacement)) + math.sqrt(sum_of_squares(laplacian))
        return relative(math.inf if math.isnan(error) else error, self._size)

    def _laplacian(self, frame: Floats) -> Floats:
        return _geometric_laplacian(frame, self._edges)


def _geometric_laplacian(frame: Floats, edges: Integers) -> Floats:
    """GL of every vertex, as ``(sum_j (v_i - v_j) / l_ij) / (sum_j 1 / l_ij)``, shape (3, V).

    Parameters
    ----------
    frame : float64 array of shape (V, 3)
    edges : integer array of shape (2, E)
        First and second vertex of each edge.
    """
    (first, second), columns, n_verts = edges, np.ascontiguousarray(frame.T), len(frame)
    differences = columns[:, first] - columns[:, second]
    lengths = np.sqrt(np.einsum("ae,ae->e", differences, differences))
    is_positive = lengths > 0
    inverse = np.divide(1.0, lengths, out=np.full_like(lengths, np.inf), where=is_positive)
    unit = np.divide(differences, lengths, out=np.zeros_like(differences), where=is_positive)
    weights = np.bincount(first, inverse, n_verts) + np.bincount(second, inverse, n_verts)
    parts = [
        np.bincount(first, column, n_verts) - np.bincount(second, column, n_verts)
        for column in unit
    ]
    # Without edges, bincount returns integers.
    sums = np.stack(parts).astype(np.float64, copy=False)
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0))
