import sys

import numpy as np
from scipy.sparse import csc_array

from meshreel.reconstruction.solver import CholeskySolver


def spd_matrix():
    root = np.random.default_rng(4).normal(size=(20, 20))
    return root @ root.T + 20 * np.eye(20)


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
