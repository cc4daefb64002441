"""Faces that fold over while a mesh follows a surface, and their repair."""

import numpy as np
import numpy.typing as npt

from meshreel.registration.fitting import uniform_laplacian
from meshreel.registration.triangle_mesh import Indices, TriangleMesh

MAX_ROUNDS = 20
"""Largest number of repairs of a mesh."""

WIDER = 6, 13
"""First rounds in which the neighbors of folded faces move too, and the neighbors of those."""

N_SMOOTHINGS = 2
RELAXATION = 0.7
"""Steps of a round, and the share of the way to the mean of its neighbors that a vertex moves."""


class Folds:
    """Finds and flattens folds: faces that oppose both a neighbor and the surface they follow.

    Neighbors that oppose each other in the key do not count: creases and errors of the raw mesh.

    Parameters
    ----------
    key : TriangleMesh
    """

    def __init__(self, key: TriangleMesh) -> None:
        self._neighbors = key.neighbors
        self._opposes_in_key = self._opposes(key)
        self._laplacian = uniform_laplacian(key.faces, len(key.vertices))

    def find(self, mesh: TriangleMesh, target: TriangleMesh) -> Indices:
        """Return the folded faces of the key mesh in a frame with this surface."""
        sides = np.flatnonzero(self._opposes(mesh) & ~self._opposes_in_key)
        found = np.unique(sides // 3)
        if not len(found):
            return found
        closest = target.closest(mesh.vertices[mesh.faces[found]].mean(axis=1))
        normals = mesh.face_normals[found], target.face_normals[closest.faces]
        return np.asarray(found[np.einsum("nc,nc->n", *normals) < 0])

    def flattened(self, mesh: TriangleMesh, target: TriangleMesh) -> TriangleMesh:
        """Return the mesh with its folds smoothed; some remain where the surface forces them.

        Each round moves the vertices of folded faces toward the means of their neighbors, which
        unfolds a patch whose boundary is convex (W. T. Tutte, "How to Draw a Graph", 1963).
        """
        for number in range(MAX_ROUNDS):
            folded = self.find(mesh, target)
            if not len(folded):
                break
            moves = np.zeros(len(mesh.vertices), bool)
            moves[mesh.faces[folded]] = True
            for first in WIDER:
                if number >= first:
                    moves[mesh.faces[moves[mesh.faces].any(axis=1)]] = True
            positions = mesh.vertices
            for _ in range(N_SMOOTHINGS):
                smoothed = positions - RELAXATION * (self._laplacian @ positions)
                positions = np.where(moves[:, None], smoothed, positions)
            mesh = TriangleMesh(positions, mesh.faces)
        return mesh

    def _opposes(self, mesh: TriangleMesh) -> npt.NDArray[np.bool_]:
        """Whether the face beyond each side has an opposing normal, of shape (3 M,)."""
        return np.asarray(mesh.cosines_across(self._neighbors) < 0)
