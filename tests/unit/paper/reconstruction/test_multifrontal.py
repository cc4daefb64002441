import numpy as np
import pytest
from scipy.sparse import csc_array, eye_array

from meshreel.errors import SolverError
from meshreel.paper.reconstruction.multifrontal import MultifrontalSolver
from samples.meshes import grid_faces, irregular_sequence
from samples.systems import irregular_faces, system_of


def right_sides(matrix, n_columns=70):
    return np.random.default_rng(6).normal(size=(matrix.shape[0], n_columns))


@pytest.mark.parametrize("normalized", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.02])
def test_solution_is_that_of_the_dense_matrix_when_the_mesh_is_irregular(normalized, share):
    laplacian, matrix = system_of(*irregular_faces(), normalized=normalized, share=share)
    values = right_sides(matrix)
    solution = MultifrontalSolver(matrix, laplacian).solve(matrix @ values)
    expected = np.linalg.solve(matrix.toarray(), matrix @ values)
    np.testing.assert_allclose(solution, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(solution, values, rtol=0, atol=1e-8)


def test_solution_is_that_of_the_dense_matrix_when_everything_is_one_front():
    sequence = irregular_sequence(1)
    laplacian, matrix = system_of(sequence.faces, sequence.n_verts)
    values = right_sides(matrix)
    solution = MultifrontalSolver(matrix, laplacian).solve(values)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix.toarray(), values), atol=1e-10)


def test_residual_is_rounding_when_the_mesh_is_large_and_has_one_anchor():
    laplacian, matrix = system_of(grid_faces(100, 100), 10000)
    values = right_sides(matrix, 5)
    solution = MultifrontalSolver(matrix, laplacian).solve(values)
    scale = np.abs(matrix).max() * np.abs(solution).max()
    assert np.abs(matrix @ solution - values).max() < 1e-14 * scale


def test_solution_is_the_same_to_the_bit_whatever_the_cores(monkeypatch):
    laplacian, matrix = system_of(*irregular_faces(), share=0.02)
    with monkeypatch.context() as patch:
        patch.setattr("meshreel.runtime.threads._core_limit", 1)
        alone = MultifrontalSolver(matrix, laplacian).solve(right_sides(matrix))
    together = MultifrontalSolver(matrix, laplacian).solve(right_sides(matrix))
    np.testing.assert_array_equal(alone, together)


def test_right_sides_are_left_as_they_are():
    laplacian, matrix = system_of(*irregular_faces())
    values = right_sides(matrix)
    MultifrontalSolver(matrix, laplacian).solve(values)
    np.testing.assert_array_equal(values, right_sides(matrix))


def test_no_columns_come_back_when_none_are_given():
    laplacian, matrix = system_of(*irregular_faces())
    assert MultifrontalSolver(matrix, laplacian).solve(right_sides(matrix, 0)).shape[1] == 0


def test_factorisation_fails_when_the_matrix_is_indefinite():
    laplacian, matrix = system_of(*irregular_faces())
    shifted = csc_array(matrix - 0.1 * eye_array(matrix.shape[0]))
    with pytest.raises(SolverError, match="not positive definite"):
        MultifrontalSolver(shifted, laplacian)


def test_factorisation_is_refused_when_it_would_take_more_than_allowed():
    laplacian, matrix = system_of(*irregular_faces())
    with pytest.raises(SolverError, match="1000 are allowed"):
        MultifrontalSolver(matrix, laplacian, max_entries=1000)
