"""Faces that fold over while a mesh follows a surface, and their repair."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.geometry.normals import face_normals, unit
from meshreel.model.sequence import Faces
from meshreel.registration.fitting import harmonic, uniform_laplacian
from meshreel.registration.triangle_mesh import Indices, TriangleMesh, mean_at_vertices, with_rings
from meshreel.runtime.extras import REGISTER_SCIPY

MIN_TURN = np.radians(30)
"""Angle by which two neighbors must bend more than in the key to count as a fold: a crease of the
key may bend a little more."""

FLATTENING_ROUNDS = 12
RESTORING_ROUNDS = 12
OPENING_ROUNDS = 16
"""Maximum number of rounds of the repairs."""

FLATTENINGS_PER_RING = 2
RESTORINGS_PER_RING = 2
OPENINGS_PER_RING = 4
"""Rounds after which one more ring of vertices around the remaining folds moves too."""

MIN_AREA = 0.1
"""Smallest area of a face that opening accepts, as seen along the normal of the surface, relative
to the mean area of the faces around it."""

AREA_WEIGHT = 2.0
DISTANCE_WEIGHT = 0.3
SMOOTHNESS = 0.1
DAMPING = 0.1
"""Weights of areas below `MIN_AREA`, of distances to the surface, of the Laplacian of the step, and
of the step itself."""


class Folds:
    """Finds and repairs folds: faces that oppose both a neighbor and the surface they follow.

    Neighbors that oppose each other in the key do not count: creases and errors of the raw mesh.

    Parameters
    ----------
    key : TriangleMesh
    max_depth : float
        Faces farther below a closed surface do not count: they are hidden.
    """

    def __init__(self, key: TriangleMesh, max_depth: float = np.inf) -> None:
        self._max_depth = max_depth
        self._neighbors = key.neighbors
        cosines = key.cosines_across(key.neighbors)
        angles = np.arccos(np.clip(cosines, 0.0, 1.0))
        self._angles_in_key = np.where(cosines < 0, np.nan, angles)
        self._laplacian = uniform_laplacian(key.faces, len(key.vertices))

    def find(
        self,
        mesh: TriangleMesh,
        target: TriangleMesh,
        min_turn: float = MIN_TURN,
        has_moved: npt.NDArray[np.bool_] | None = None,
    ) -> Indices:
        """Return the folded faces of the key mesh in a frame with this surface.

        Parameters
        ----------
        min_turn : float
            Smallest angle, in radians, by which a face and its neighbor bend more than in the key.
        has_moved : bool array of shape (V,), optional
            Only faces at these vertices, and their neighbors, are searched.
        """
        angles, neighbors = self._angles_in_key.reshape(-1, 3), self._neighbors.reshape(-1, 3)
        if has_moved is None:
            faces, normals = np.arange(len(mesh.faces)), mesh.face_normals
            others = normals[neighbors]
        else:
            is_near = with_rings(mesh.faces, has_moved)
            faces = np.flatnonzero(is_near[mesh.faces].any(axis=1))
            normals, others = (
                unit(face_normals(mesh.vertices, mesh.faces[numbers.ravel()]))
                for numbers in (faces, neighbors[faces])
            )
            angles = angles[faces]
        limits = np.minimum(np.cos(angles + min_turn), 0.0)
        cosines = np.einsum("nc,nkc->nk", normals, others.reshape(-1, 3, 3))
        bends = (cosines < limits).any(axis=1)
        faces, normals = faces[bends], normals[bends]
        if not len(faces):
            return np.empty(0, np.int64)
        centers = mesh.vertices[mesh.faces[faces]].mean(axis=1)
        closest = target.closest(centers)
        opposes = np.einsum("nc,nc->n", normals, target.face_normals[closest.faces]) < 0
        is_deep = closest.distances > self._max_depth
        return np.asarray(faces[opposes & ~(is_deep & target.encloses(centers, closest))])

    def flatten(self, mesh: TriangleMesh, target: TriangleMesh) -> TriangleMesh:
        """Return the mesh with the vertices of folds at the means of their neighbors.

        That unfolds a patch whose boundary is convex (W. T. Tutte, "How to Draw a Graph", 1963),
        but moves it off creases of the surface. Some folds remain where the surface forces them.
        """
        is_moving = None
        for number in range(FLATTENING_ROUNDS):
            folds = self.find(mesh, target, 0.0, is_moving)
            if not len(folds):
                break
            is_moving = _vertices_around(mesh, folds, number // FLATTENINGS_PER_RING)
            mesh = mesh.moved(harmonic(self._laplacian, mesh.vertices, is_moving))
        return mesh

    def restore(self, mesh: TriangleMesh, target: TriangleMesh, rest: Floats) -> TriangleMesh:
        """Return the mesh with its shape at rest where it folds; few folds remain.

        The displacement from rest is averaged around folds. That keeps small parts of the key
        which the surface lacks, and which would fold if they were pressed onto it; but the mesh
        fits the surface less closely there.

        Parameters
        ----------
        rest : float64 array of shape (V, 3)
            Positions with few folds: those of the key, as moved by nodes.
        """
        for number in range(RESTORING_ROUNDS):
            folds = self.find(mesh, target)
            if not len(folds):
                break
            is_moving = _vertices_around(mesh, folds, 1 + number // RESTORINGS_PER_RING)
            displacements = harmonic(self._laplacian, mesh.vertices - rest, is_moving)
            mesh = mesh.moved(rest + displacements)
        return mesh

    def open(self, mesh: TriangleMesh, target: TriangleMesh) -> TriangleMesh:
        """Return the mesh with folds turned until they agree with the surface; some may remain.

        The vertices stay near the surface, also at creases; but where it is rough, new folds may
        arise, which `flatten` removes.
        """
        is_moving = None
        for number in range(OPENING_ROUNDS):
            folds = self.find(mesh, target, 0.0, is_moving)
            if not len(folds):
                break
            is_moving = _vertices_around(mesh, folds, 1 + number // OPENINGS_PER_RING)
            positions = mesh.vertices.copy()
            positions[is_moving] += self._opening_step(mesh, target, is_moving)
            mesh = mesh.moved(positions)
        return mesh

    def _opening_step(
        self, mesh: TriangleMesh, target: TriangleMesh, is_moving: npt.NDArray[np.bool_]
    ) -> Floats:
        """Return a Gauss-Newton step of the vertices that move, of shape (N, 3).

        It enlarges small areas, and reduces distances of vertices and of centroids from the planes
        of the surface.
        """
        sparse, linalg = REGISTER_SCIPY.load("sparse"), REGISTER_SCIPY.load("sparse.linalg")
        moving_faces = np.flatnonzero(is_moving[mesh.faces].any(axis=1))
        moving_verts = np.flatnonzero(is_moving)
        faces = mesh.faces[moving_faces]
        corners = mesh.vertices[faces]
        centroids = corners.mean(axis=1)
        normals, heights = _planes(target, centroids)
        across = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        gradients = 0.5 * np.cross(normals[:, None], across)
        missing_areas = -0.5 * np.einsum("nkc,nkc->n", gradients, corners)
        is_corner = np.zeros(len(is_moving), bool)
        is_corner[faces] = True
        around = mesh.faces[is_corner[mesh.faces].any(axis=1)]
        areas = np.linalg.norm(face_normals(mesh.vertices, around), axis=1) / 2
        areas = mean_at_vertices(areas, around, len(is_moving))[faces].mean(axis=1)
        missing_areas += MIN_AREA * areas
        is_small = missing_areas > 0
        scale = AREA_WEIGHT / np.sqrt(areas[is_small])
        vertex_normals, vertex_heights = _planes(target, mesh.vertices[moving_verts])
        rows = [
            _jacobian_rows(faces[is_small], scale[:, None, None] * gradients[is_small], is_moving),
            _jacobian_rows(
                faces, np.repeat(DISTANCE_WEIGHT / 3 * normals[:, None], 3, axis=1), is_moving
            ),
            _jacobian_rows(
                moving_verts[:, None], DISTANCE_WEIGHT * vertex_normals[:, None], is_moving
            ),
        ]
        residuals = (
            scale * missing_areas[is_small],
            DISTANCE_WEIGHT * heights,
            DISTANCE_WEIGHT * vertex_heights,
        )
        jacobian = sparse.vstack(rows)
        laplacian = SMOOTHNESS * self._laplacian[is_moving][:, is_moving]
        smoothness = laplacian.T @ laplacian + DAMPING * sparse.identity(len(moving_verts))
        normal_matrix = jacobian.T @ jacobian + sparse.kron(smoothness, np.eye(3))
        rhs = jacobian.T @ np.concatenate(residuals)
        return np.asarray(linalg.spsolve(normal_matrix.tocsc(), rhs)).reshape(-1, 3)


def _vertices_around(mesh: TriangleMesh, faces: Indices, n_rings: int) -> npt.NDArray[np.bool_]:
    """Return whether each vertex belongs to these faces, or to rings of faces around them."""
    is_corner = np.zeros(len(mesh.vertices), bool)
    is_corner[mesh.faces[faces]] = True
    return with_rings(mesh.faces, is_corner, n_rings)


def _planes(target: TriangleMesh, points: Floats) -> tuple[Floats, Floats]:
    """Return the normals of the closest faces, and the distances of their planes along them."""
    closest = target.closest(points)
    normals = target.face_normals[closest.faces]
    return normals, np.asarray(np.einsum("nc,nc->n", normals, closest.points - points))


def _jacobian_rows(
    vertices: Faces | Indices, values: Floats, is_moving: npt.NDArray[np.bool_]
) -> Any:
    """Return derivatives with respect to the positions of the vertices that move, as a matrix.

    Parameters
    ----------
    vertices : integer array of shape (N, K)
    values : float64 array of shape (N, K, 3)
        Derivatives of N numbers with respect to the positions of their K vertices.
    is_moving : bool array of shape (V,)
    """
    sparse = REGISTER_SCIPY.load("sparse")
    n_rows, n_verts, _ = values.shape
    columns = 3 * vertices[:, :, None].astype(np.int64) + np.arange(3)
    ends = np.arange(0, 3 * n_verts * n_rows + 1, 3 * n_verts)
    shape = n_rows, 3 * len(is_moving)
    rows = sparse.csr_matrix((values.ravel(), columns.ravel(), ends), shape)
    return rows[:, np.flatnonzero(np.repeat(is_moving, 3))]
