"""The deformation graph: nodes on a key mesh that move its vertices by rotations and translations.

R. W. Sumner, J. Schmid, M. Pauly, "Embedded Deformation for Shape Manipulation", 2007.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces
from meshreel.registration.triangle_mesh import Indices
from meshreel.runtime.extras import REGISTER_SCIPY

N_NEAREST = 5
"""Number of nodes that move each vertex."""

MAX_DISTANCES = 4_000_000
"""Largest number of distances from nodes to vertices in memory."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Rotations and translations of the nodes.

    Attributes
    ----------
    rotations : float64 array of shape (N, 3, 3)
    translations : float64 array of shape (N, 3)
    """

    rotations: Floats
    translations: Floats

    @classmethod
    def at_rest(cls, n_nodes: int) -> "Pose":
        """Return the pose of the key."""
        return cls(np.tile(np.eye(3), (n_nodes, 1, 1)), np.zeros((n_nodes, 3)))

    def moved(self, steps: Floats) -> "Pose":
        """Return the pose after rotation vectors and translations, of shape (N, 6)."""
        return Pose(rotations_of(steps[:, :3]) @ self.rotations, self.translations + steps[:, 3:])

    def extrapolated(self, previous: "Pose") -> "Pose":
        """Return the next pose at constant velocity, given the pose before this one."""
        rotation = self.rotations @ previous.rotations.transpose(0, 2, 1)
        return Pose(rotation @ self.rotations, 2 * self.translations - previous.translations)


@dataclass(frozen=True, eq=False)
class PosedMesh:
    """A posed mesh and how it depends on the pose.

    Attributes
    ----------
    positions : float64 array of shape (V, 3)
    base : float64 array of shape (V, 3)
        Positions without details, as the nodes alone move them.
    arms : float64 array of shape (V, K, 3)
        Vectors from the nodes of each vertex to where they alone would move it.
    vertex_rotations : float64 array of shape (V, 3, 3)
        Weighted means of the rotations of the nodes of each vertex.
    """

    positions: Floats
    base: Floats
    arms: Floats
    vertex_rotations: Floats


@dataclass(frozen=True, eq=False)
class DeformationGraph:
    """Nodes on a key mesh, and the weights with which they move its vertices.

    Attributes
    ----------
    nodes : float64 array of shape (N, 3)
        Positions of the nodes on the key.
    nearest : int64 array of shape (V, K)
        The nodes that move each vertex.
    weights : float64 array of shape (V, K)
        Their weights, which sum to 1.
    edges : int64 array of shape (E, 2)
        Pairs of nodes that move a common vertex, in both directions.
    """

    nodes: Floats
    nearest: Indices
    weights: Floats
    edges: Indices
    _offsets: Floats = field(repr=False)

    @classmethod
    def of_mesh(cls, vertices: Floats, faces: Faces, spacing: float) -> "DeformationGraph":
        """Place nodes at a spacing along the surface of a key.

        Distances are measured along edges, so that an arm does not move the hip that it touches.
        """
        lengths = edge_lengths(vertices, faces)
        nodes = _spread(lengths, spacing)
        nearest, weights = _nearest_nodes(lengths, nodes, spacing)
        sparse = REGISTER_SCIPY.load("sparse")
        rows = np.repeat(np.arange(len(vertices)), nearest.shape[1])
        has_weight = weights.ravel() > 0
        shape = len(vertices), len(nodes)
        moves = sparse.csr_matrix(
            (np.ones(int(has_weight.sum())), (rows[has_weight], nearest.ravel()[has_weight])), shape
        )
        shared = (moves.T @ moves).tocoo()
        is_edge = shared.row != shared.col
        edges = np.stack([shared.row[is_edge], shared.col[is_edge]], axis=1).astype(np.int64)
        offsets = vertices[:, None] - vertices[nodes][nearest]
        return cls(vertices[nodes], nearest, weights, edges, offsets)

    def posed(self, pose: Pose, details: Floats) -> PosedMesh:
        """Return the mesh in a pose.

        Parameters
        ----------
        details : float64 array of shape (V, 3)
            Displacements of the vertices, which turn with the nodes.
        """
        arms = np.einsum("vkij,vkj->vki", pose.rotations[self.nearest], self._offsets)
        ends = arms + (self.nodes + pose.translations)[self.nearest]
        vertex_rotations = np.einsum("vk,vkij->vij", self.weights, pose.rotations[self.nearest])
        base = np.einsum("vk,vki->vi", self.weights, ends)
        return PosedMesh(
            base + np.einsum("vij,vj->vi", vertex_rotations, details), base, arms, vertex_rotations
        )


def rotations_of(vectors: Floats) -> Floats:
    """Return the rotation matrices of rotation vectors of shape (N, 3), by Rodrigues' formula."""
    angles = np.linalg.norm(vectors, axis=1)[:, None, None]
    axes = vectors / np.maximum(angles[:, 0], 1e-12)
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axes[:, 2], axes[:, 1], -axes[:, 0]
    cross -= cross.transpose(0, 2, 1)
    return np.asarray(np.eye(3) + np.sin(angles) * cross + (1.0 - np.cos(angles)) * (cross @ cross))


def edge_lengths(vertices: Floats, faces: Faces) -> Any:
    """Return the symmetric sparse matrix of the lengths of the edges, above 0."""
    sparse = REGISTER_SCIPY.load("sparse")
    ends = undirected_edges(faces)
    lengths = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1) + 1e-12
    upper = sparse.csr_matrix((lengths, (ends[:, 0], ends[:, 1])), (len(vertices),) * 2)
    return (upper + upper.T).tocsr()


def _spread(lengths: Any, spacing: float) -> Indices:
    """Return vertices at least a spacing apart along edges, so that no further one fits between."""
    dijkstra = REGISTER_SCIPY.load("sparse.csgraph").dijkstra
    n_verts = lengths.shape[0]
    is_free, nodes = np.ones(n_verts, bool), []
    for vertex in np.random.default_rng(0).permutation(n_verts).tolist():
        if is_free[vertex]:
            nodes.append(vertex)
            is_free[np.isfinite(dijkstra(lengths, indices=vertex, limit=spacing))] = False
    return np.array(nodes)


def _nearest_nodes(lengths: Any, nodes: Indices, spacing: float) -> tuple[Indices, Floats]:
    """Return the nearest nodes of each vertex along edges, and weights that fall to 0 at the last.

    Returns
    -------
    nearest : int64 array of shape (V, K)
    weights : float64 array of shape (V, K)
    """
    dijkstra = REGISTER_SCIPY.load("sparse.csgraph").dijkstra
    n_verts, n_candidates = lengths.shape[0], min(N_NEAREST + 1, len(nodes))
    best = np.full((n_verts, n_candidates), np.inf)
    nearest = np.zeros((n_verts, n_candidates), np.int64)
    size = max(1, MAX_DISTANCES // n_verts)
    for start in range(0, len(nodes), size):
        batch = nodes[start : start + size]
        distances = np.hstack([best, dijkstra(lengths, indices=batch, limit=3 * spacing).T])
        numbers = np.hstack([nearest, np.tile(np.arange(start, start + len(batch)), (n_verts, 1))])
        order = np.argsort(distances, axis=1, kind="stable")[:, :n_candidates]
        best = np.take_along_axis(distances, order, axis=1)
        nearest = np.take_along_axis(numbers, order, axis=1)
    is_reached = np.isfinite(best)
    last = np.where(is_reached, best, 0.0).max(axis=1, keepdims=True) * 1.0001 + 1e-12
    weights = np.where(is_reached, 1.0 - np.where(is_reached, best, 0.0) / last, 0.0) ** 2
    if n_candidates > N_NEAREST:
        nearest, weights = nearest[:, :-1], weights[:, :-1]
    weights[weights.sum(axis=1) <= 0, 0] = 1.0
    return nearest, weights / weights.sum(axis=1, keepdims=True)
