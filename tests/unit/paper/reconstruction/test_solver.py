import sys

import numpy as np
import pytest
from scipy.sparse import csc_array

from meshreel.errors import SolverError
from meshreel.paper.reconstruction import solver as module
from meshreel.paper.reconstruction.solver import CholeskySolver
from samples.systems import irregular_faces, system_of


def spd_matrix():
    root = np.random.default_rng(4).normal(size=(20, 20))
    return root @ root.T + 20 * np.eye(20)


class Failing:
    """Stands for a factorisation that gives up."""

    def __init__(self, matrix, graph):
        raise SolverError("planted")


def test_solution_solves_the_system_when_there_are_many_right_hand_sides():
    right = np.random.default_rng(5).normal(size=(20, 150))
    solution = CholeskySolver(csc_array(spd_matrix())).solve(right)
    np.testing.assert_allclose(spd_matrix() @ solution, right, atol=1e-10)


def test_fallback_gives_the_same_when_cholespy_is_missing(monkeypatch):
    right = np.random.default_rng(5).normal(size=(20, 3))
    expected = CholeskySolver(csc_array(spd_matrix())).solve(right)
    monkeypatch.setitem(sys.modules, "cholespy", None)
    fallback = CholeskySolver(csc_array(spd_matrix())).solve(right)
    np.testing.assert_allclose(fallback, expected, atol=1e-12)


@pytest.mark.parametrize("has_graph", [False, True])
@pytest.mark.parametrize("normalized", [False, True])
def test_large_systems_give_the_same_as_small_ones_would(monkeypatch, normalized, has_graph):
    laplacian, matrix = system_of(*irregular_faces(), normalized=normalized)
    right = matrix @ np.random.default_rng(5).normal(size=(matrix.shape[0], 40))
    expected = CholeskySolver(matrix).solve(right)
    monkeypatch.setattr(module, "MIN_MULTIFRONTAL", 0)
    monkeypatch.setattr(module, "_cholespy_solve", None)
    solution = CholeskySolver(matrix, laplacian if has_graph else None).solve(right)
    np.testing.assert_allclose(solution, expected, rtol=0, atol=1e-8)


def test_others_take_over_when_our_own_gives_up(monkeypatch):
    laplacian, matrix = system_of(*irregular_faces())
    right = matrix @ np.ones((matrix.shape[0], 1))
    monkeypatch.setattr(module, "MIN_MULTIFRONTAL", 0)
    monkeypatch.setattr(module, "MultifrontalSolver", Failing)
    np.testing.assert_allclose(CholeskySolver(matrix, laplacian).solve(right), 1.0, atol=1e-8)


def test_small_systems_do_not_ask_our_own(monkeypatch):
    monkeypatch.setattr(module, "MultifrontalSolver", None)
    solution = CholeskySolver(csc_array(spd_matrix())).solve(np.ones((20, 1)))
    np.testing.assert_allclose(spd_matrix() @ solution, 1.0, atol=1e-12)
