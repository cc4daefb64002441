"""Eq. 6 of the paper, on the eigenvectors of L."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from meshreel.errors import InvalidInputError
from meshreel.paper.laplacian import uniform_laplacian
from meshreel.paper.subspace.graph_fourier import check_basis_size, graph_fourier_basis
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
    """Five octahedra: every eigenvalue of L has a multiplicity of at least five."""
    faces = np.concatenate([octahedron_faces() + 6 * k for k in range(5)])
    laplacian = uniform_laplacian(faces, 30)
    dense = graph_fourier_basis(laplacian, 30)[:, :9]
    np.testing.assert_allclose(graph_fourier_basis(laplacian, 9), dense, atol=1e-8)


def test_too_large_basis_is_refused():
    with pytest.raises(InvalidInputError, match=r"10000 graph frequencies of 200000 vertices"):
        graph_fourier_basis(csr_array((200_000, 200_000)), 10_000)


def test_size_named_in_the_message_is_accepted():
    with pytest.raises(InvalidInputError, match="at most") as caught:
        check_basis_size(50_000, 9_000)
    possible = int(str(caught.value).split("at most ")[1].split()[0])
    check_basis_size(50_000, possible)
