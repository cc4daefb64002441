import sys

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array
from scipy.spatial import Delaunay

from meshreel.errors import SolverError
from meshreel.paper.laplacian import component_labels, uniform_laplacian
from meshreel.paper.reconstruction_system import CholeskySolver
from samples.meshes import grid_faces, octahedron_faces


def irregular_faces(n_points=900):
    """Random triangles with holes, a strip, small bodies, a hub, long edges, odd faces."""
    rng = np.random.default_rng(3)
    faces = Delaunay(rng.random((n_points, 2))).simplices
    faces = faces[rng.random(len(faces)) > 0.2]
    strip = grid_faces(2, 60) + n_points
    bodies = [octahedron_faces() + n_points + 120 + 6 * k for k in range(20)]
    hub = n_points + 240
    ring = rng.choice(n_points, 60, replace=False)
    spokes = np.stack([np.full(59, hub), ring[:-1], ring[1:]], axis=1)
    odd = [[5, 5, 5], [7, 7, 9], [1, 2, 3], [1, 2, 3]]
    long = rng.integers(0, n_points, (5, 3))
    faces = np.concatenate([faces, strip, *bodies, spokes, odd, long])
    return np.random.default_rng(4).permutation(hub + 3)[faces], hub + 3


def system_of(faces, n_verts, *, normalized, share):
    """The matrix of Eq. 12 with one anchor in each component and some more."""
    laplacian = uniform_laplacian(faces, n_verts, normalized=normalized)
    selected = np.random.default_rng(5).random(n_verts) < share
    _, labels = component_labels(faces, n_verts)
    selected[np.unique(labels, return_index=True)[1]] = True
    return csc_array(laplacian.T @ laplacian + diags_array(selected.astype(float)))


def spd_matrix():
    root = np.random.default_rng(4).normal(size=(20, 20))
    return root @ root.T + 20 * np.eye(20)


def test_solution_solves_the_system_for_many_right_hand_sides():
    right = np.random.default_rng(5).normal(size=(20, 150))
    solution = CholeskySolver(csc_array(spd_matrix())).solve(right)
    np.testing.assert_allclose(spd_matrix() @ solution, right, atol=1e-10)


def test_fallback_gives_the_same_solution_without_cholespy(monkeypatch):
    right = np.random.default_rng(5).normal(size=(20, 3))
    expected = CholeskySolver(csc_array(spd_matrix())).solve(right)
    monkeypatch.setitem(sys.modules, "cholespy", None)
    fallback = CholeskySolver(csc_array(spd_matrix())).solve(right)
    np.testing.assert_allclose(fallback, expected, atol=1e-12)


@pytest.mark.parametrize("normalized", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.02])
def test_solution_on_an_irregular_mesh_equals_the_dense_one(normalized, share):
    matrix = system_of(*irregular_faces(), normalized=normalized, share=share)
    values = np.random.default_rng(6).normal(size=(matrix.shape[0], 70))
    solution = CholeskySolver(matrix).solve(matrix @ values)
    np.testing.assert_allclose(solution, values, rtol=0, atol=1e-8)


@pytest.mark.parametrize("solver", ["cholespy", "splu"])
def test_singular_matrix_is_refused(monkeypatch, solver):
    if solver == "splu":
        monkeypatch.setitem(sys.modules, "cholespy", None)
    with pytest.raises(SolverError, match="cannot be factored"):
        CholeskySolver(csc_array(np.ones((4, 4))))
