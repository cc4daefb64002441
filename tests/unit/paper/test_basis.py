"""Eq. 6, Eq. 8, Eq. 9 and Alg. 1 of the paper, also on the eigenvectors of L."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories, fix_signs
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError
from meshreel.paper import graph_fourier
from meshreel.paper.basis import (
    advance_basis,
    align_basis,
    expand,
    modes_for_energy,
    project,
    ritz_vectors,
)
from meshreel.paper.graph_fourier import (
    basis_bytes,
    check_basis_size,
    estimated_seconds,
    graph_fourier_basis,
)
from meshreel.paper.laplacian import delta_coordinates, uniform_laplacian
from samples.meshes import grid_faces, octahedron_faces, waving_grid

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


LAPLACIAN = uniform_laplacian(grid_faces(9, 8), 72)


@pytest.mark.parametrize("n_modes", [1, 10, 72])
def test_basis_of_both_solvers_is_orthonormal(n_modes):
    basis = graph_fourier_basis(LAPLACIAN, n_modes)
    assert np.abs(basis.T @ basis - np.eye(n_modes)).max() < 1e-10


def test_columns_are_nearly_eigenvectors_of_ascending_frequency():
    basis = graph_fourier_basis(LAPLACIAN, 10)
    frequencies = np.einsum("vk,vk->k", basis, LAPLACIAN @ basis)
    residual = LAPLACIAN @ basis - basis * frequencies
    assert np.linalg.norm(residual, axis=0).max() < 2e-3  # what is added to the diagonal
    assert (np.diff(frequencies) > -1e-3).all()


def test_both_solvers_agree_for_multiple_eigenvalues():
    """Eight octahedra: every eigenvalue of L has a multiplicity of at least eight."""
    faces = np.concatenate([octahedron_faces() + 6 * k for k in range(8)])
    laplacian = uniform_laplacian(faces, 48)
    dense = graph_fourier_basis(laplacian, 48)[:, :9]
    np.testing.assert_allclose(graph_fourier_basis(laplacian, 9), dense, atol=1e-8)


@pytest.mark.parametrize("n_modes", [13, 72])
def test_signs_are_fixed_in_every_column(n_modes, monkeypatch):
    monkeypatch.setattr(graph_fourier, "COLUMNS_AT_ONCE", 5)
    basis = graph_fourier_basis(LAPLACIAN, n_modes)
    np.testing.assert_array_equal(basis, fix_signs(basis))


@pytest.mark.parametrize(
    ("laplacian", "n_modes", "memory", "wanted"),
    [
        (csr_array((200_000, 200_000)), 10_000, None, r"200000 vertices take 32 GB .* 2\.15 GB"),
        (LAPLACIAN, 72, "80kB", r"72 graph frequencies of 72 vertices take 82\.9 kB"),
        (LAPLACIAN, 10, "12kB", r"10 graph frequencies of 72 vertices take 12\.1 kB"),
    ],
)
def test_basis_is_refused_when_it_takes_too_much_memory(laplacian, n_modes, memory, wanted):
    with pytest.raises(InvalidInputError, match=f"{wanted}.* memory"):
        graph_fourier_basis(laplacian, n_modes, memory=memory)


@pytest.mark.parametrize("n_modes", [0, 73])
def test_number_of_modes_out_of_range_is_refused(n_modes):
    with pytest.raises(InvalidInputError, match=r"n_modes must be in 1\.\.72"):
        graph_fourier_basis(LAPLACIAN, n_modes)


def test_memory_of_the_dense_solver_is_two_matrices():
    assert basis_bytes(9971, 9971) == 2 * 8 * 9971**2
    assert basis_bytes(9971, 499) == 8 * 9971 * 999


def test_progress_states_memory_and_estimated_time_when_decoders_refuse(monkeypatch):
    stages = []
    graph_fourier_basis(LAPLACIAN, 72, progress=lambda stage, _: stages.append(stage))
    assert stages == ["decomposing 72 graph frequencies with 82.9 kB"]
    monkeypatch.setattr(graph_fourier, "MAX_WORK", 72**3 - 1)
    monkeypatch.setattr(graph_fourier, "estimated_seconds", lambda *_: 240.0)
    graph_fourier_basis(LAPLACIAN, 72, progress=lambda stage, _: stages.append(stage))
    assert stages[2:] == [f"{stages[0]}, about 4 minutes (an estimate)"]


@pytest.mark.parametrize(
    ("n_modes", "wanted"), [(72, 2 * (72 / 9) ** 3), (7, 2 * 72 * 35**2 / 9**3)]
)
def test_estimate_grows_with_the_work_of_the_solver(n_modes, wanted, monkeypatch):
    clock = iter([10.0, 12.0])
    monkeypatch.setattr(graph_fourier, "SAMPLE_VERTS", 9)
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    assert estimated_seconds(LAPLACIAN, n_modes) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("n_verts", "n_modes"), [(9971, 2626), (9971, 9971), (4097, 4097), (50_000, 1173)]
)
def test_decoders_refuse_a_basis_that_takes_more_than_minutes(n_verts, n_modes):
    with pytest.raises(InvalidInputError, match="option all_frequencies"):
        check_basis_size(n_verts, n_modes)


@pytest.mark.parametrize(
    ("n_verts", "n_modes"), [(9971, 2625), (4096, 4096), (50_000, 1172), (1, 1)]
)
def test_decoders_accept_a_basis_that_takes_minutes(n_verts, n_modes):
    check_basis_size(n_verts, n_modes)


def test_size_named_in_the_message_is_accepted():
    with pytest.raises(InvalidInputError, match="at most") as caught:
        check_basis_size(50_000, 9_000)
    possible = int(str(caught.value).split("at most ")[1].split()[0])
    check_basis_size(50_000, possible)
