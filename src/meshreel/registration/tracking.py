"""Tracking: the nodes of a key mesh follow the surfaces of neighboring frames, coarse to fine.

A deformation graph is fitted by Gauss-Newton steps to corresponding points, which are near in place
and in direction, found from both sides. Rotations of neighboring nodes should agree (O. Sorkine, M.
Alexa, "As-Rigid-As-Possible Surface Modeling", 2007).
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from meshreel.arrays import Floats
from meshreel.registration.graph import DeformationGraph, Pose, PosedMesh
from meshreel.registration.triangle_mesh import Indices, TriangleMesh
from meshreel.runtime.extras import REGISTER_SCIPY

NODE_SPACING = 0.05
"""Distance of the nodes along the surface, in longest sides of the box of all frames."""

N_POINTS = 3000
"""Number of vertices of the key whose correspondences a Gauss-Newton step uses; the frame has half
as many."""


class Stage(NamedTuple):
    """Gauss-Newton steps of the deformation graph.

    Attributes
    ----------
    rigidity : float
        Weight of the differences between neighboring nodes.
    spread : float
        Distance at which a correspondence counts half.
    n_steps : int
        Largest number of steps.
    """

    rigidity: float
    spread: float
    n_steps: int


class Attempt(NamedTuple):
    """How to follow a frame.

    Attributes
    ----------
    predicts : bool
        Whether constant velocity is considered.
    stages : tuple of Stage
        Coarse to fine.
    if_failed : bool or None
        True: only if the last attempt lost the surface, or if faces still fold over; False: only
        if neither is the case; None: always.
    """

    predicts: bool
    stages: tuple[Stage, ...]
    if_failed: bool | None = None


LIGHT = Stage(0.4, 0.02, 3)
STAGES = Stage(3.0, 0.1, 5), Stage(1.0, 0.05, 4), LIGHT, Stage(0.15, 0.02, 4)

ATTEMPTS = (
    Attempt(True, (LIGHT,)),
    Attempt(True, (LIGHT._replace(n_steps=15),), if_failed=False),
    Attempt(True, STAGES),
    Attempt(False, (Stage(10.0, 0.2, 10), *STAGES), if_failed=True),
)
"""The ways to follow a frame, tried in order until one meets the tolerance: more steps where the
first ones nearly do, and a stiff start where the others lose the surface or leave folds."""

DAMPING = 1e-6
"""Weight of the squared step of each node, which holds nodes without correspondences."""

RESIDUAL = 1e-3
"""Relative residual at which conjugate gradients stop."""

MAX_ITERATIONS = 200

MIN_COSINE = 0.4
"""Smallest cosine between normals of corresponding points."""

TANGENTIAL = 0.05
"""Weight of distances along the surface, relative to those along its normal."""

TANGENTIAL_AT_EDGE = 0.5
"""`TANGENTIAL` for two vertices on boundaries or sharp creases, which should meet."""

MAX_CONFORMING_STEPS = 20
"""Largest number of steps toward given positions."""

CONVERGED = 6e-4
"""Largest translation of a node in a step after which a stage ends."""

DETAIL_SHARE = 0.9
"""Share of the displacement from the posed key that the next frame begins with."""


Pairs = tuple[Indices, Indices, Floats, Floats]
"""Corresponding vertices of a mesh and of its target, and two weights, as `_correspondences`."""


@dataclass(frozen=True, eq=False)
class State:
    """State of the tracker: pose and details of a frame, and the pose of the previous frame."""

    pose: Pose
    details: Floats
    before: Pose | None


class Tracker:
    """Moves a key mesh from frame to frame. All lengths are in longest sides of the sequence's box.

    Parameters
    ----------
    key : TriangleMesh
    """

    def __init__(self, key: TriangleMesh) -> None:
        self._faces, self._rest = key.faces, key.vertices
        self._is_edge, self._is_outline = key.is_edge, key.is_outline
        self._is_near_boundary = key.is_near_boundary
        self._graph = DeformationGraph.of_mesh(key.vertices, key.faces, NODE_SPACING)
        order = np.random.default_rng(0).permutation(len(key.vertices))
        self._points = np.sort(order[:N_POINTS])

    def start(self) -> State:
        """Return the state at the key."""
        n_nodes, n_verts = len(self._graph.nodes), len(self._graph.nearest)
        return State(Pose.at_rest(n_nodes), np.zeros((n_verts, 3)), None)

    def track(
        self, state: State, target: TriangleMesh, attempt: Attempt = ATTEMPTS[0]
    ) -> tuple[Pose, PosedMesh]:
        """Return the pose in the next frame, and the mesh in it with the details of the last."""
        rng = np.random.default_rng(len(target.vertices))
        pose = self._predict(state, target) if attempt.predicts else state.pose
        for stage in attempt.stages:
            for _ in range(stage.n_steps):
                posed = self._graph.posed(pose, state.details)
                samples = rng.integers(0, len(target.vertices), len(self._points) // 2)
                pairs = self._correspondences(posed, target, samples, stage.spread)
                step = self._step(pose, posed, target, pairs, stage.rigidity)
                pose = pose.moved(step)
                if np.abs(step[:, 3:]).max() < CONVERGED:
                    break
        return pose, self._graph.posed(pose, state.details)

    def conform(self, state: State, positions: Floats) -> tuple[Pose, PosedMesh]:
        """Return the pose that brings the vertices near positions of shape (V, 3), as `track`."""
        target, pose = TriangleMesh(positions, self._faces), state.pose
        ones = np.ones(len(self._points))
        for _ in range(MAX_CONFORMING_STEPS):
            posed = self._graph.posed(pose, state.details)
            pairs = self._points, self._points, ones, ones
            step = self._step(pose, posed, target, pairs, LIGHT.rigidity)
            pose = pose.moved(step)
            if np.abs(step[:, 3:]).max() < CONVERGED:
                break
        return pose, self._graph.posed(pose, state.details)

    def arrive(self, state: State, pose: Pose, posed: PosedMesh, positions: Floats) -> State:
        """Return the state after a frame, given the mesh fitted to it, of shape (V, 3)."""
        change = np.einsum("vji,vj->vi", posed.vertex_rotations, positions - posed.positions)
        return State(pose, DETAIL_SHARE * (state.details + change), state.pose)

    def _predict(self, state: State, target: TriangleMesh) -> Pose:
        """Return the pose of the last frame or one of constant velocity, whichever is nearer."""
        if state.before is None:
            return state.pose
        candidates = [state.pose, state.pose.extrapolated(state.before)]
        distances = []
        for pose in candidates:
            mesh = TriangleMesh(self._graph.posed(pose, state.details).positions, self._faces)
            nearest, _ = target.oriented_tree.query(mesh.oriented[self._points[::4]])
            distances.append(np.minimum(nearest, 0.1).mean())
        return candidates[int(np.argmin(distances))]

    def _step(
        self, pose: Pose, posed: PosedMesh, target: TriangleMesh, pairs: Pairs, rigidity: float
    ) -> Floats:
        """Return rotation vectors and translations of all nodes, of shape (N, 6)."""
        sparse, linalg = REGISTER_SCIPY.load("sparse"), REGISTER_SCIPY.load("sparse.linalg")
        distances, rhs = self._distance_equations(posed, target, *pairs)
        rows, residuals = self._rigidity_rows(pose, rigidity)
        differences = rows.T @ rows + DAMPING * sparse.identity(rows.shape[1])
        normal = distances + differences.tobsr((6, 6))
        solution, _ = linalg.cg(
            normal,
            rhs - rows.T @ residuals,
            rtol=RESIDUAL,
            maxiter=MAX_ITERATIONS,
            M=_block_inverse(normal),
        )
        return np.asarray(solution).reshape(-1, 6)

    def _correspondences(
        self, posed: PosedMesh, target: TriangleMesh, samples: Indices, spread: float
    ) -> Pairs:
        """Return vertices of the mesh and of the target that correspond, and two weights.

        The weights are that of their distance, and that of its part along the surface relative to
        the part along the normal. Vertices that may be in a hole of the other surface have no
        weight. If there are holes, neither have vertices whose corresponding point belongs to a
        distant part of the key: a missing hand must not stick to the hip.
        """
        mesh = TriangleMesh(posed.positions, self._faces)
        verts = self._points
        _, targets = target.oriented_tree.query(mesh.oriented[verts])
        _, nearest = mesh.oriented_tree.query(target.oriented[samples])
        is_beyond = np.concatenate(
            [
                ~self._is_outline[verts] & target.is_near_boundary[targets],
                ~target.is_outline[samples] & self._is_near_boundary[nearest],
            ]
        )
        if target.boundaries[0].max(initial=0.0) > NODE_SPACING:
            _, returned = mesh.oriented_tree.query(target.oriented[targets])
            apart = np.linalg.norm(self._rest[verts] - self._rest[returned], axis=1)
            gaps = np.linalg.norm(mesh.vertices[verts] - target.vertices[targets], axis=1)
            is_beyond[: len(verts)] |= apart > NODE_SPACING + 2 * gaps
        verts, targets = np.concatenate([verts, nearest]), np.concatenate([targets, samples])
        distances = np.linalg.norm(mesh.vertices[verts] - target.vertices[targets], axis=1)
        cosines = np.einsum("nc,nc->n", mesh.vertex_normals[verts], target.vertex_normals[targets])
        corresponds = (cosines > MIN_COSINE) & ~is_beyond
        weights = corresponds * spread**2 / (spread**2 + distances**2)
        are_edges = self._is_edge[verts] & target.is_edge[targets]
        tangential = np.where(are_edges, TANGENTIAL_AT_EDGE, TANGENTIAL)
        return verts, targets, np.sqrt(weights), tangential

    def _distance_equations(
        self,
        posed: PosedMesh,
        target: TriangleMesh,
        verts: Indices,
        targets: Indices,
        weights: Floats,
        tangential: Floats,
    ) -> tuple[Any, Floats]:
        """Return the normal equations of weighted distances to the planes of the target.

        A share of the distance along the plane counts too, so that nothing slides. Matrices have a
        block for each node, which makes their products twice as fast.
        """
        sparse = REGISTER_SCIPY.load("sparse")
        nearest, arms = self._graph.nearest[verts], posed.arms[verts]
        normals = target.vertex_normals[targets]
        gaps = posed.positions[verts] - target.vertices[targets]
        n_rows, n_near = nearest.shape
        n_nodes = len(self._graph.nodes)
        ends = np.arange(0, n_near * n_rows + 1, n_near)
        node_weights = weights[:, None] * self._graph.weights[verts]
        rotations = np.cross(arms, normals[:, None])
        translations = np.broadcast_to(normals[:, None], arms.shape)
        values = node_weights[:, :, None] * np.concatenate([rotations, translations], axis=2)
        blocks = values.reshape(-1, 1, 6)
        jacobian = sparse.bsr_matrix((blocks, nearest.ravel(), ends), (n_rows, 6 * n_nodes))
        shares = (tangential[:, None] * node_weights).ravel()
        share = sparse.csr_matrix((shares, nearest.ravel(), ends), (n_rows, n_nodes))
        products = (share.T @ share).tocsr()
        tangents = products.data[:, None, None] * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
        normal = jacobian.T @ jacobian + sparse.bsr_matrix(
            (tangents, products.indices, products.indptr), (6 * n_nodes, 6 * n_nodes)
        )
        rhs = -(jacobian.T @ (weights * np.einsum("nc,nc->n", gaps, normals))).reshape(-1, 6)
        rhs[:, 3:] -= share.T @ ((tangential * weights)[:, None] * gaps)
        return normal, rhs.ravel()

    def _rigidity_rows(self, pose: Pose, weight: float) -> tuple[Any, Floats]:
        """Return the Jacobian of differences between motions of neighbors, and the differences."""
        sparse = REGISTER_SCIPY.load("sparse")
        nodes, (first, second) = self._graph.nodes, self._graph.edges.T
        turned = np.einsum("eij,ej->ei", pose.rotations[first], nodes[second] - nodes[first])
        gaps = turned + (nodes + pose.translations)[first] - (nodes + pose.translations)[second]
        ones, parts = np.ones(len(first)), []
        for axis in range(3):
            after, last = (axis + 1) % 3, (axis + 2) % 3
            values = np.stack([turned[:, last], -turned[:, after], ones, -ones], axis=1)
            columns = np.stack(
                [6 * first + after, 6 * first + last, 6 * first + 3 + axis, 6 * second + 3 + axis],
                axis=1,
            )
            ends = np.arange(0, 4 * len(first) + 1, 4)
            shape = len(first), 6 * len(nodes)
            parts.append(sparse.csr_matrix((weight * values.ravel(), columns.ravel(), ends), shape))
        return sparse.vstack(parts), weight * gaps.T.ravel()


def _block_inverse(matrix: Any) -> Any:
    """Return the inverse of the diagonal blocks of a block matrix, to precondition with."""
    sparse = REGISTER_SCIPY.load("sparse")
    rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    diagonal = matrix.data[matrix.indices == rows]
    n_blocks = len(diagonal)
    return sparse.bsr_matrix(
        (np.linalg.inv(diagonal), np.arange(n_blocks), np.arange(n_blocks + 1)), matrix.shape
    )
