"""Least squares by Gram matrices."""

import numpy as np
import pytest

from meshreel.codec.subspace.least_squares import solve_gram

RNG = np.random.default_rng(3)
ROWS, GOALS = RNG.normal(size=(5, 40)), RNG.normal(size=(7, 40))


def solution(rows):
    return solve_gram(rows @ rows.T, rows @ GOALS.T)


def test_weights_equal_those_of_lstsq():
    expected = np.linalg.lstsq(ROWS.T, GOALS.T, rcond=None)[0]
    np.testing.assert_allclose(solution(ROWS), expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("more", [ROWS[:1], 0 * ROWS[:1], ROWS[:1] + 1e-9 * ROWS[1:2]])
def test_weights_of_dependent_rows_have_minimum_norm(more):
    rows = np.concatenate([ROWS, more])
    weights = solution(rows)
    np.testing.assert_allclose(weights.T @ rows, solution(ROWS).T @ ROWS, atol=1e-6)
    assert np.abs(weights).max() < 10 * np.abs(solution(ROWS)).max()


@pytest.mark.parametrize("shape", [(0, 7), (0, 0)])
def test_no_rows_give_no_weights(shape):
    assert solve_gram(np.zeros((0, 0)), np.zeros(shape)).shape == shape
