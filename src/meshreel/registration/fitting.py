"""The fit of a mesh to a surface: squared distances in both directions, with smooth changes."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.geometry.normals import unit
from meshreel.model.sequence import Faces
from meshreel.registration.triangle_mesh import Samples, TriangleMesh
from meshreel.runtime.extras import REGISTER_SCIPY
from meshreel.runtime.threads import in_threads

MIN_COSINE = 0.5
"""Minimum cosine between the normals of corresponding points."""

REACH = 0.02
"""Maximum distance between corresponding points."""

BOUNDARY_COSINE = 0.5
"""A closest point is on a boundary if the cosine between its direction and normal is below this."""

MAX_STEPS = 40
"""Maximum number of steps of conjugate gradients."""

RESIDUAL = 1e-2
"""Relative residual at which conjugate gradients stop: correspondences change anyway."""

DAMPING = 1e-3
"""Weight of the squared change of each vertex, which holds vertices without correspondences."""

HARMONIC_DAMPING = 1e-6
"""Weight of the current values of harmonic vectors; it makes the equations solvable for components
whose vertices all move."""


@dataclass(frozen=True)
class Rows:
    """Equations that move points of the mesh.

    Attributes
    ----------
    vertices : int32 array of shape (N, 3)
        The vertices whose weighted mean is the point.
    weights : float64 array of shape (N, 3)
    directions : float64 array of shape (N, 3)
        Unit vectors.
    offsets : float64 array of shape (N,)
        The distance that the point should move in its direction.
    areas : float64 array of shape (N,)
    """

    vertices: Faces
    weights: Floats
    directions: Floats
    offsets: Floats
    areas: Floats


class TwoSidedFit:
    """Fits positions of one mesh to surfaces.

    The sum of squared distances from points of the mesh to the surface and from points of the
    surface to the mesh is minimized by Gauss-Newton steps: each distance is linearized along the
    normal of the surface, which lets the mesh slide along it. The change is smooth: its Laplacian
    is penalized.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
    """

    def __init__(self, faces: Faces, n_verts: int) -> None:
        self._n_verts = n_verts
        self._laplacian = uniform_laplacian(faces, n_verts)
        squares = self._laplacian.multiply(self._laplacian)
        self._squared_columns = np.asarray(squares.sum(axis=0)).ravel()

    def step(
        self,
        mesh: TriangleMesh,
        rest: Floats,
        target: TriangleMesh,
        smoothness: float,
        *,
        covers: bool = True,
    ) -> Floats:
        """Return positions of shape (V, 3) that fit a surface better.

        Parameters
        ----------
        mesh : TriangleMesh
            The mesh before the step, in longest sides of the box of the sequence.
        rest : float64 array of shape (V, 3)
            The positions from which the change is smooth.
        smoothness : float
            Weight of the squared Laplacian of the change, relative to that of one vertex's share
            of the distances.
        covers : bool
            Whether distances from points of the surface to the mesh count.
        """
        parts = [
            partial(rows_to_surface, mesh, mesh.centroid_samples(), target),
            partial(rows_to_surface, mesh, mesh.vertex_samples(), target),
        ]
        if covers:
            parts += [
                partial(rows_from_surface, mesh, target, target.centroid_samples()),
                partial(rows_from_surface, mesh, target, target.vertex_samples()),
            ]
        rows = concatenate_rows(*in_threads(lambda rows_of: rows_of(), parts))
        if not len(rows.offsets):
            return mesh.vertices
        return mesh.vertices + self._solve(rows, mesh.vertices - rest, smoothness)

    def _solve(self, rows: Rows, change: Floats, smoothness: float) -> Floats:
        """Return the change of the positions that solves the equations, of shape (V, 3)."""
        sparse, linalg = REGISTER_SCIPY.load("sparse"), REGISTER_SCIPY.load("sparse.linalg")
        n_rows, size = len(rows.offsets), 3 * self._n_verts
        scale = np.sqrt(rows.areas * (self._n_verts / rows.areas.sum()))
        values = (scale[:, None] * rows.weights)[:, :, None] * rows.directions[:, None]
        columns = 3 * rows.vertices[:, :, None] + np.arange(3)
        jacobian = sparse.csr_matrix(
            (values.ravel(), columns.ravel(), np.arange(0, 9 * n_rows + 1, 9)), (n_rows, size)
        )
        transposed = jacobian.T.tocsr()
        laplacian, weight = self._laplacian, smoothness

        def apply_smoothness(field: Floats) -> Floats:
            return np.asarray(weight * (laplacian.T @ (laplacian @ field)) + DAMPING * field)

        def product(flat: Floats) -> Floats:
            return np.asarray(
                transposed @ (jacobian @ flat) + apply_smoothness(flat.reshape(-1, 3)).ravel()
            )

        rhs = transposed @ (scale * rows.offsets) - apply_smoothness(change).ravel()
        squares = np.bincount(columns.ravel(), values.ravel() ** 2, size)
        diagonal = squares + np.repeat(weight * self._squared_columns, 3) + DAMPING
        solution, _ = linalg.cg(
            linalg.LinearOperator((size, size), product),
            rhs,
            rtol=RESIDUAL,
            maxiter=MAX_STEPS,
            M=sparse.diags(1.0 / diagonal),
        )
        return np.asarray(solution).reshape(-1, 3)


def rows_to_surface(mesh: TriangleMesh, samples: Samples, target: TriangleMesh) -> Rows:
    """Return equations that move samples of the mesh to their closest points on the target.

    At the boundary of the target, only faces at an outline of the mesh move; others span a hole.
    """
    indices, closest = target.corresponding(samples, MIN_COSINE, REACH)
    is_inside = ~mesh.is_outline[mesh.faces[samples.faces[indices]]].any(axis=1)
    is_free = ~(is_inside & target.ends_before(samples.points[indices], closest))
    indices, points, faces = indices[is_free], closest.points[is_free], closest.faces[is_free]
    directions, offsets = _directions(points - samples.points[indices], target.face_normals[faces])
    vertices = mesh.faces[samples.faces[indices]]
    return Rows(vertices, samples.weights[indices], directions, offsets, samples.areas[indices])


def rows_from_surface(mesh: TriangleMesh, target: TriangleMesh, samples: Samples) -> Rows:
    """Return equations that move the closest points of samples of the target to them."""
    indices, closest = mesh.corresponding(samples, MIN_COSINE, REACH)
    gaps = samples.points[indices] - closest.points
    directions, offsets = _directions(gaps, samples.normals[indices])
    return Rows(
        mesh.faces[closest.faces], closest.weights, directions, offsets, samples.areas[indices]
    )


def _directions(gaps: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return the directions in which points should move, and how far.

    The direction is the normal, so that the mesh can slide. A point beyond the boundary of the
    other surface moves straight to its closest point instead.
    """
    offsets = np.einsum("nc,nc->n", gaps, normals)
    lengths = np.linalg.norm(gaps, axis=1)
    is_beyond = np.abs(offsets) < BOUNDARY_COSINE * lengths
    directions = np.where(is_beyond[:, None], unit(gaps), normals)
    return directions, np.where(is_beyond, lengths, offsets)


def concatenate_rows(*blocks: Rows) -> Rows:
    """Return the rows of all blocks."""
    return Rows(
        np.concatenate([rows.vertices for rows in blocks]),
        np.concatenate([rows.weights for rows in blocks]),
        np.concatenate([rows.directions for rows in blocks]),
        np.concatenate([rows.offsets for rows in blocks]),
        np.concatenate([rows.areas for rows in blocks]),
    )


def uniform_laplacian(faces: Faces, n_verts: int) -> Any:
    """Return the matrix that subtracts from each vertex the mean of its neighbors."""
    sparse = REGISTER_SCIPY.load("sparse")
    first, second = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ones = np.ones(2 * len(first))
    ends = np.concatenate([first, second]), np.concatenate([second, first])
    adjacency = sparse.csr_matrix((ones, ends), (n_verts, n_verts))
    adjacency.data[:] = 1.0
    degrees = np.asarray(adjacency.sum(axis=1)).ravel()
    neighbor_means = sparse.diags(1.0 / np.maximum(degrees, 1.0)) @ adjacency
    return (sparse.diags((degrees > 0).astype(float)) - neighbor_means).tocsr()


def harmonic(
    laplacian: Any,
    vectors: Floats,
    is_moving: npt.NDArray[np.bool_],
    damping: float = HARMONIC_DAMPING,
) -> Floats:
    """Return vectors of shape (V, 3), replaced by means of their neighbors where they move.

    `laplacian` is that of `uniform_laplacian`, and `damping` the weight of their current values.
    """
    sparse, linalg = REGISTER_SCIPY.load("sparse"), REGISTER_SCIPY.load("sparse.linalg")
    rows, result = laplacian[is_moving], vectors.copy()
    rhs = damping * vectors[is_moving] - rows[:, ~is_moving] @ vectors[~is_moving]
    matrix = rows[:, is_moving] + damping * sparse.identity(rows.shape[0])
    result[is_moving] = linalg.spsolve(matrix.tocsc(), rhs)
    return result
