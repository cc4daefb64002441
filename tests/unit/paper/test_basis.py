"""Eq. 6, Eq. 8, Eq. 9 and Alg. 1 of the paper."""

import numpy as np
import pytest

from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories, fix_signs
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError
from meshreel.paper.basis import (
    advance_basis,
    align_basis,
    expand,
    modes_for_energy,
    project,
    ritz_vectors,
)
from meshreel.paper.laplacian import delta_coordinates, uniform_laplacian
from samples.meshes import waving_grid

VALUES = np.array([[80.0, 8.0, 1.0], [8.0, 2.0, 1.0]])  # 88, 10, 2 of 100


def test_projection_with_all_rows_returns_the_deltas():
    sequence = waving_grid()
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.extent))
    _, basis = eigen_trajectories(autocorrelation(matrices), sequence.n_frames)
    laplacian = uniform_laplacian(sequence.faces, sequence.n_verts)
    for axis in range(3):
        deltas = delta_coordinates(laplacian, matrices[axis].T)  # Eq. 8: L A^T
        back = expand(basis[axis], project(basis[axis], deltas.T))
        np.testing.assert_allclose(back.T, deltas, atol=1e-13)


@pytest.mark.parametrize(
    ("share", "expected"), [(0.5, 1), (0.88, 1), (0.89, 2), (0.99, 3), (1.0, 3)]
)
def test_modes_contain_the_requested_share_of_energy(share, expected):
    assert modes_for_energy(VALUES, 100.0, 100.0, share) == expected


def test_energy_of_the_path_does_not_count():
    # The shape has 10 of 100: leaving out 2 keeps 0.8 of it.
    assert modes_for_energy(VALUES, 100.0, 10.0, 0.79) == 2
    assert modes_for_energy(VALUES, 100.0, 10.0, 0.81) == 3


def test_one_mode_is_kept_without_energy():
    assert modes_for_energy(np.zeros((3, 5)), 0.0, 0.0, 0.9999) == 1


def coherent_frames(phase=0.0):
    """Return a block of 20 frames: slow waves of falling amplitude, rotated by the phase."""
    rng = np.random.default_rng(6)
    time = np.arange(20) / 20 + phase
    waves = np.stack([np.cos(2 * np.pi * k * time + k) for k in range(8)], axis=1)
    fields = rng.normal(size=(8, 60)) * 0.5 ** np.arange(8)[:, None]
    return (waves @ fields)[None]


def random_basis(n_modes=4):
    return np.linalg.qr(np.random.default_rng(9).normal(size=(1, 20, n_modes))).Q


def subspace_angle(basis, reference):
    """Sine of the largest angle between two subspaces."""
    return np.sqrt(max(0.0, 1 - np.linalg.svd(basis[0].T @ reference[0])[1].min() ** 2))


def iterations_to_reach(start, correlation, exact, tolerance=1e-3):
    for count in range(1, 200):
        if subspace_angle(advance_basis(correlation, start, count), exact) < tolerance:
            return count
    raise AssertionError("it does not converge")


def test_basis_converges_to_the_eigenvectors_of_a_fixed_matrix():
    correlation = autocorrelation(coherent_frames())
    _, expected = eigen_trajectories(correlation, 4)
    basis = advance_basis(correlation, random_basis(), 300)
    np.testing.assert_allclose(fix_signs(basis), expected, atol=1e-8)


@pytest.mark.parametrize("n_iterations", [1, 3, 20])
def test_advanced_basis_is_orthonormal(n_iterations):
    basis = advance_basis(autocorrelation(coherent_frames()), random_basis(), n_iterations)
    assert np.abs(np.swapaxes(basis, 1, 2) @ basis - np.eye(4)).max() < 1e-12


def test_warm_start_needs_fewer_steps_for_coherent_blocks():
    _, before = eigen_trajectories(autocorrelation(coherent_frames(0.0)), 4)
    correlation = autocorrelation(coherent_frames(0.02))
    _, exact = eigen_trajectories(correlation, 4)
    warm = iterations_to_reach(before, correlation, exact)
    assert warm < iterations_to_reach(random_basis(), correlation, exact)


def test_blocks_of_unequal_length_are_refused():
    with pytest.raises(InvalidInputError, match="R has 19 frames and the basis 20"):
        advance_basis(np.eye(19)[None], random_basis(), 1)


def test_ritz_vectors_diagonalize_the_matrix():
    correlation = autocorrelation(coherent_frames())
    turned = ritz_vectors(correlation, random_basis())
    within = (np.swapaxes(turned, 1, 2) @ correlation @ turned)[0]
    np.testing.assert_allclose(within, np.diag(np.diag(within)), atol=1e-12 * within[0, 0])
    assert np.all(np.diff(np.diag(within)) < 0)


def test_ritz_vectors_keep_the_span_of_the_basis():
    basis = random_basis()
    turned = ritz_vectors(autocorrelation(coherent_frames()), basis)
    before, after = (one @ np.swapaxes(one, 1, 2) for one in (basis, turned))
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_ritz_vectors_keep_columns_beyond_the_rank():
    frames = coherent_frames()
    leading = eigen_trajectories(autocorrelation(frames), 2)[1]
    flat = leading @ (np.swapaxes(leading, 1, 2) @ frames)
    basis = eigen_trajectories(autocorrelation(frames), 5)[1]
    turned = ritz_vectors(autocorrelation(flat), basis)
    alike = np.abs(np.swapaxes(turned, 1, 2) @ basis)[0]
    np.testing.assert_allclose(np.sort(alike, axis=1), np.sort(np.eye(5), axis=1), atol=1e-9)


def test_shuffled_and_flipped_columns_are_matched():
    basis = random_basis(6)
    shuffled = basis[:, :, [3, 0, 5, 1, 4, 2]] * [-1, 1, 1, -1, 1, -1]
    np.testing.assert_array_equal(align_basis(shuffled, basis), basis)
