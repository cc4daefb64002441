"""Creases of a surface: sharp edges, at which it is meant to look faceted."""

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces

CREASE_DEG = 60.0
"""Smallest dihedral turn between two faces whose edge is a crease."""


def creased_share(vertices: npt.NDArray[np.floating], faces: Faces) -> float:
    """Length of creases as a share of that of all edges between two faces; 1 without such edges.

    Boundary edges, edges of more than two faces and faces without area do not count.

    Parameters
    ----------
    vertices : float array of shape (V, 3)
    faces : integer array of shape (M, 3)
    """
    normals = face_normals(vertices, faces)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    ends, pairs = _inner_edges(faces, len(vertices))
    has_area = (lengths[pairs, 0] > 0).all(axis=1)
    ends, pairs = ends[has_area], pairs[has_area]
    sides = np.linalg.norm(np.diff(vertices[ends].astype(np.float64), axis=1)[:, 0], axis=1)
    cosines = np.einsum("ij,ij->i", units[pairs[:, 0]], units[pairs[:, 1]])
    is_crease = cosines < np.cos(np.radians(CREASE_DEG))
    return float(sides[is_crease].sum() / sides.sum()) if sides.sum() > 0 else 1.0


def _inner_edges(faces: Faces, n_verts: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Ends and faces, each of shape (E, 2), of edges that exactly two faces have."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
    keys = edges[:, 0] * n_verts + edges[:, 1]
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    counts = np.diff(starts, append=len(keys))
    first = starts[counts == 2]
    pairs = np.stack([order[first], order[first + 1]], axis=1)
    return edges[pairs[:, 0]], pairs // 3
