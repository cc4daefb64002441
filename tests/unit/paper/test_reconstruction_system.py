"""Eq. 11 and Eq. 12 of the paper."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.spatial import Delaunay

import meshreel
from meshreel.errors import MemoryLimitError, SolverError
from meshreel.model.geometry.connectivity import component_labels
from meshreel.paper.laplacian import delta_coordinates, uniform_laplacian
from meshreel.paper.reconstruction_system import MAX_ROW_ENTRIES, ReconstructionSystem
from samples.meshes import grid_faces, octahedron_faces

FACES, N_VERTS = grid_faces(6, 7), 42


def columns(n_verts=N_VERTS):
    return np.random.default_rng(2).normal(size=(n_verts, 5))


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


def pyramid_faces(n_sides, n_tips):
    """A closed band of fans from several tips, each next to all other vertices."""
    side = np.arange(n_sides)
    fans = [np.stack([np.full(n_sides, n_sides + tip), side, np.roll(side, -1)], axis=1)
            for tip in range(n_tips)]  # fmt: skip
    return np.concatenate(fans), n_sides + n_tips


def test_responses_are_columns_of_the_dense_inverse():
    laplacian, anchors = uniform_laplacian(FACES, N_VERTS, normalized=True), np.array([3, 30])
    matrix = (laplacian.T @ laplacian).toarray()
    matrix[anchors, anchors] += 1
    result = ReconstructionSystem(laplacian, anchors).responses(np.array([30, 5]))
    np.testing.assert_allclose(result, np.linalg.inv(matrix)[:, [30, 5]], atol=1e-9)


def test_error_names_a_component_without_an_anchor():
    faces = np.concatenate([FACES, octahedron_faces() + N_VERTS])
    laplacian = uniform_laplacian(faces, N_VERTS + 6)
    with pytest.raises(SolverError, match=r"1 of 2 connected components .* 6 vertices"):
        ReconstructionSystem(laplacian, np.array([0]))


@pytest.mark.parametrize("normalized", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.02])
def test_solution_on_an_irregular_mesh_is_the_original(normalized, share):
    faces, n_verts = irregular_faces()
    laplacian = uniform_laplacian(faces, n_verts, normalized=normalized)
    selected = np.random.default_rng(5).random(n_verts) < share
    labels = component_labels(faces, n_verts)
    selected[np.unique(labels, return_index=True)[1]] = True
    anchors, values = np.flatnonzero(selected), columns(n_verts)
    system = ReconstructionSystem(laplacian, anchors)
    solution = system.solve(delta_coordinates(laplacian, values), values[anchors])
    np.testing.assert_allclose(solution, values, rtol=0, atol=1e-8)


@pytest.mark.parametrize("n_tips", [1, 2, 5])
def test_vertices_of_high_degree_are_solved_without_a_dense_factor(n_tips):
    n_sides = 4 * MAX_ROW_ENTRIES
    faces, n_verts = pyramid_faces(n_sides, n_tips)
    laplacian, values = uniform_laplacian(faces, n_verts, normalized=True), columns(n_verts)
    deltas = delta_coordinates(laplacian, values) + 0.1 * values[::-1]
    stacked = np.vstack([laplacian.toarray(), np.eye(n_verts)[[7, 30]]])
    right = np.vstack([deltas, values[[7, 30]]])
    system = ReconstructionSystem(laplacian, np.array([7, 30]))
    expected = np.linalg.lstsq(stacked, right, rcond=None)[0]
    np.testing.assert_allclose(system.solve(deltas, values[[7, 30]]), expected, atol=1e-9)
    assert system._factor.nnz < n_verts * n_verts / 8


def test_a_singular_system_is_refused():
    squares_underflow = csr_array(1e-200 * np.array([[1, -1], [-1, 1]]))
    with pytest.raises(SolverError, match="cannot be factored"):
        ReconstructionSystem(squares_underflow, np.array([0]))


def test_a_system_above_the_memory_limit_is_refused():
    stream = meshreel.encode(meshreel.simulate_flag(3), method="pca", n_modes=2)
    with pytest.raises(MemoryLimitError, match="the factored system of 2704 vertices would take"):
        meshreel.decode(stream, memory="4MB")
    assert meshreel.decode(stream, memory="8MB").n_frames == 3
