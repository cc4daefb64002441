"""Eq. 5 and Eq. 7 of the paper, and least squares by Gram matrices."""

import numpy as np
import pytest

from meshreel.codec.subspace.pca import (
    autocorrelation,
    eigen_trajectories,
    fix_signs,
    truncated_pca,
)
from meshreel.codec.subspace.trajectories import (
    BoundingFrame,
    bounding_frame,
    from_matrices,
    to_matrices,
)
from meshreel.model.extent import extent_of


def frames(n_frames=9, n_verts=40):
    return np.random.default_rng(3).normal(size=(3, n_frames, n_verts))


def test_autocorrelation_contains_the_inner_products_of_frames():
    matrices = frames()
    correlation = autocorrelation(matrices)
    assert correlation.shape == (3, 9, 9)
    np.testing.assert_allclose(correlation[1, 2, 5], matrices[1, 2] @ matrices[1, 5])


def test_complete_basis_is_orthonormal():
    _, basis = eigen_trajectories(autocorrelation(frames()), 9)
    gram = np.swapaxes(basis, 1, 2) @ basis
    assert np.abs(gram - np.eye(9)).max() < 1e-10


def test_all_eigenpairs_reproduce_the_matrix():
    correlation = autocorrelation(frames())
    values, basis = eigen_trajectories(correlation, 9)
    rebuilt = (basis * values[:, None, :]) @ np.swapaxes(basis, 1, 2)
    np.testing.assert_allclose(rebuilt, correlation, atol=1e-11)


def test_eigenvalues_descend():
    values, basis = eigen_trajectories(autocorrelation(frames()), 4)
    assert values.shape == (3, 4)
    assert basis.shape == (3, 9, 4)
    assert (np.diff(values, axis=1) <= 0).all()


def test_signs_do_not_depend_on_the_solver():
    _, basis = eigen_trajectories(autocorrelation(frames()), 9)
    flipped = basis * np.where(np.arange(9) % 2, -1.0, 1.0)
    np.testing.assert_array_equal(fix_signs(flipped), basis)


def test_sign_rule_ignores_rounding_in_ties():
    column = np.array([[-1.0], [0.1], [1.0]])
    nudge = np.array([[0.0], [0.0], [1e-12]])
    np.testing.assert_allclose(fix_signs(column + nudge), fix_signs(column - nudge), atol=1e-11)


@pytest.mark.parametrize("shape", [(30, 60), (40, 40)])
def test_weak_modes_are_found_after_strong_ones(shape):
    rng = np.random.default_rng(3)
    strengths = 10.0 ** -np.arange(0, 11, 0.5)
    left, right = (np.linalg.qr(rng.normal(size=(n, len(strengths))))[0] for n in shape)
    matrix = left * strengths @ right.T
    least = 2e-10
    values, vectors = truncated_pca(
        lambda piece: matrix[:, piece], matrix @ matrix.T, shape[1], least
    )
    np.testing.assert_allclose(values, strengths[strengths > least], rtol=1e-3)
    assert np.abs(vectors.T @ vectors - np.eye(len(values))).max() < 1e-9
    assert np.linalg.norm(matrix - vectors @ (vectors.T @ matrix)) < 2 * least


def test_number_of_weak_modes_is_at_most_the_rank():
    rng = np.random.default_rng(4)
    matrix = rng.normal(size=(12, 3)) @ rng.normal(size=(3, 50))
    values, _ = truncated_pca(lambda piece: matrix[:, piece], matrix @ matrix.T, 50, 1e-300)
    assert len(values) == 3


def test_zero_matrix_has_one_mode():
    values, _ = truncated_pca(lambda _: np.zeros((4, 9)), np.zeros((4, 4)), 9, 1e-9)
    assert values.tolist() == [0.0]


@pytest.mark.parametrize(("offset", "size"), [(0.0, 1.0), (1e6, 1.0), (0.0, 1e-6), (-5e8, 1e3)])
def test_matrices_are_invariant_to_translation_and_scale(offset, size):
    shape = np.random.default_rng(1).uniform(size=(4, 10, 3))
    here = to_matrices(shape, bounding_frame(extent_of(shape)))
    moved = shape * size + offset
    there = to_matrices(moved, bounding_frame(extent_of(moved)))
    np.testing.assert_allclose(there, here, atol=4 * np.finfo(float).eps * (1 + abs(offset) / size))


def test_positions_are_restored_from_matrices():
    shape = np.random.default_rng(1).uniform(size=(4, 10, 3)) + 100
    frame = bounding_frame(extent_of(shape))
    back = from_matrices(to_matrices(shape, frame), frame, np.float64)
    np.testing.assert_allclose(back, shape, atol=1e-13)


def test_scale_of_coincident_vertices_is_one():
    assert bounding_frame(extent_of(np.full((2, 3, 3), 7.0))).scale == 1.0


def test_to_matrices_does_not_modify_its_input():
    vertices = np.array([[[1.0, 2.0, 4.0]]])
    to_matrices(vertices, BoundingFrame((1.0, 1.0, 1.0), 2.0))
    np.testing.assert_array_equal(vertices, [[[1.0, 2.0, 4.0]]])
