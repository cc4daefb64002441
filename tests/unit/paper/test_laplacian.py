"""Eq. 1, Eq. 2, Eq. 3 and Eq. 4 of the paper."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import component_labels
from meshreel.paper.laplacian import (
    adjacency_matrix,
    cotangent_laplacian,
    delta_coordinates,
    uniform_laplacian,
)
from samples.meshes import grid_faces, irregular_sequence


@pytest.mark.parametrize("normalized", [False, True])
def test_rows_sum_to_zero_when_the_mesh_is_irregular(normalized):
    sequence = irregular_sequence()
    laplacian = uniform_laplacian(sequence.faces, sequence.n_verts, normalized=normalized)
    assert np.abs(laplacian.sum(axis=1)).max() < 1e-15


def test_laplacian_is_degree_minus_adjacency_when_the_mesh_is_a_triangle():
    laplacian = uniform_laplacian(np.array([[0, 1, 2]], np.int32), 4)
    expected = [[2, -1, -1, 0], [-1, 2, -1, 0], [-1, -1, 2, 0], [0, 0, 0, 0]]
    np.testing.assert_array_equal(laplacian.toarray(), expected)


def test_normalized_deltas_are_differences_from_the_neighbor_mean():
    # Vertex 0 is at 6, its neighbors at 0 and 3: 6 - 1.5 (Eq. 3).
    laplacian = uniform_laplacian(np.array([[0, 1, 2]], np.int32), 3, normalized=True)
    deltas = delta_coordinates(laplacian, np.array([[6.0], [0.0], [3.0]]))
    np.testing.assert_allclose(deltas.ravel(), [4.5, -4.5, 0.0])


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


def test_components_include_isolated_vertices():
    sequence = irregular_sequence()
    # Vertex 0, the grid, the octahedron, the last vertex.
    assert component_labels(sequence.faces, sequence.n_verts).max() + 1 == 4
