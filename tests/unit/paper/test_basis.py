"""Eq. 6, Eq. 8 and Eq. 9 of the paper."""

import numpy as np
import pytest

from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.paper.basis import expand, modes_for_energy, project
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
