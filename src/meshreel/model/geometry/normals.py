"""Normals of faces and vertices."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.sequence import Faces


def face_normals(vertices: npt.NDArray[np.floating], faces: Faces) -> Floats:
    """Normals of all faces, whose length is twice the area; zero for degenerate faces.

    Parameters
    ----------
    vertices : float array of shape (..., V, 3)
    faces : integer array of shape (M, 3)

    Returns
    -------
    float64 array of shape (..., M, 3), by the right-hand rule
    """
    a, b, c = (vertices[..., faces[:, k], :].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(vertices: npt.NDArray[np.floating], faces: Faces) -> Floats:
    """Unit normals of the vertices of one frame: area-weighted means over their faces.

    Parameters
    ----------
    vertices : float array of shape (V, 3)
    faces : integer array of shape (M, 3)

    Returns
    -------
    float64 array of shape (V, 3); zero where all faces are degenerate
    """
    normals = face_normals(vertices, faces).T
    columns = [np.bincount(faces.ravel(), np.repeat(x, 3), len(vertices)) for x in normals]
    return unit(np.stack(columns, axis=1))


def unit(vectors: Floats) -> Floats:
    """Return vectors of shape (..., 3) with length 1; zero vectors stay."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))
