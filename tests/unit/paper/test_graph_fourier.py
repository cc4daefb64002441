"""Eq. 6 of the paper, on the eigenvectors of L."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from meshreel.codec.subspace.pca import fix_signs
from meshreel.errors import InvalidInputError
from meshreel.paper import graph_fourier
from meshreel.paper.graph_fourier import (
    basis_bytes,
    check_basis_size,
    estimated_seconds,
    graph_fourier_basis,
)
from meshreel.paper.laplacian import uniform_laplacian
from samples.meshes import grid_faces, octahedron_faces

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
        (csr_array((200_000, 200_000)), 10_000, None, r"200000 vertices take 32 GB .* 8\.59 GB"),
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
