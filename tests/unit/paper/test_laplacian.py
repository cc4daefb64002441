"""Eq. 1, Eq. 2, Eq. 3 and Eq. 4 of the paper."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.paper.laplacian import (
    adjacency_matrix,
    cotangent_laplacian,
    delta_coordinates,
    uniform_laplacian,
)
from samples.meshes import grid_faces


def test_deltas_are_rejected_when_vertex_counts_differ():
    with pytest.raises(InvalidInputError, match="20 vertices; got 19 rows"):
        delta_coordinates(uniform_laplacian(grid_faces(4, 5), 20), np.zeros((19, 3)))


def cotangent_weights(faces, shape):
    """Return clamped half sums of the cotangents opposite to each edge, as a dense matrix."""
    weights, is_edge = np.zeros((2, len(shape), len(shape)))
    for face in faces:
        for k in range(3):
            apex, a, b = np.roll(face, k)
            u, v = shape[a] - shape[apex], shape[b] - shape[apex]
            area = np.linalg.norm(np.cross(u, v))
            is_edge[[a, b], [b, a]] = 1
            weights[[a, b], [b, a]] += 0.5 / np.tan(np.arctan2(area, u @ v)) if area else 0
    return np.clip(weights, 0.05, 20) * is_edge


def test_cotangent_weights_are_clamped_cotangents_of_angles():
    rng = np.random.default_rng(6)
    faces, shape = grid_faces(5, 6), rng.normal(size=(31, 3))
    shape[7] = shape[8] + 1e-4 * rng.normal(size=3)  # angles near 0 and near 180 degrees
    shape[20], shape[21] = shape[14], shape[15]  # faces without area
    weights = cotangent_weights(faces, shape)
    assert (weights == 0.05).any()
    assert (weights == 20).any()
    sums = weights.sum(axis=1)
    assert sums[30] == 0  # a vertex without edges
    expected = np.diag(sums > 0) - weights / np.maximum(sums, 1e-300)[:, None]
    laplacian = cotangent_laplacian(faces, shape).toarray()
    np.testing.assert_allclose(laplacian, expected, atol=1e-12)


def test_adjacency_is_binary_when_faces_are_duplicated():
    faces = np.array([[0, 1, 2], [0, 1, 2]], np.int32)
    expected = np.ones((3, 3)) - np.eye(3)
    np.testing.assert_array_equal(adjacency_matrix(faces, 3).toarray(), expected)
