"""Eq. 11 and Eq. 12 of the paper."""

import numpy as np
import pytest

from meshreel.errors import SolverError
from meshreel.paper.laplacian import delta_coordinates, uniform_laplacian
from meshreel.paper.reconstruction_system import ReconstructionSystem
from samples.meshes import grid_faces, octahedron_faces

FACES, N_VERTS = grid_faces(6, 7), 42


def columns():
    return np.random.default_rng(2).normal(size=(N_VERTS, 5))


@pytest.mark.parametrize("normalized", [False, True])
@pytest.mark.parametrize("anchors", [[17], [0, 20, 41], list(range(42))])
def test_solution_without_quantization_is_the_original(normalized, anchors):
    laplacian = uniform_laplacian(FACES, N_VERTS, normalized=normalized)
    system = ReconstructionSystem(laplacian, np.array(anchors))
    solution = system.solve(delta_coordinates(laplacian, columns()), columns()[anchors])
    np.testing.assert_allclose(solution, columns(), atol=1e-10)


def test_solution_minimizes_the_stacked_system():
    laplacian = uniform_laplacian(FACES, N_VERTS)
    anchors = np.array([3, 30])
    deltas = delta_coordinates(laplacian, columns()) + 0.1 * columns()[::-1]
    stacked = np.vstack([laplacian.toarray(), np.eye(N_VERTS)[anchors]])
    right = np.vstack([deltas, columns()[anchors]])
    expected = np.linalg.lstsq(stacked, right, rcond=None)[0]
    solution = ReconstructionSystem(laplacian, anchors).solve(deltas, columns()[anchors])
    np.testing.assert_allclose(solution, expected, atol=1e-10)


def test_solution_with_one_anchor_is_the_pseudo_inverse():
    """Eq. 11: L alone; the anchor fixes the translation and nothing else."""
    laplacian = uniform_laplacian(FACES, N_VERTS, normalized=True)
    deltas = delta_coordinates(laplacian, columns()) + 0.1 * columns()[::-1]
    # The matrix has one singular value of 0, up to rounding, which must not be inverted.
    expected = np.linalg.pinv(laplacian.toarray(), rcond=1e-10) @ deltas
    solution = ReconstructionSystem(laplacian, np.array([9])).solve(deltas, columns()[[9]])
    np.testing.assert_allclose(solution - solution[9], expected - expected[9], atol=1e-9)
    np.testing.assert_allclose(solution[9], columns()[9], atol=1e-10)


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
