"""Normals of a surface, and rotation of normals."""

import numpy as np
import pytest

from conformance import predicted
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import find_rotations, surface_normals
from meshreel.model.geometry.normals import vertex_normals
from samples.meshes import waving_grid

RNG = np.random.default_rng(21)


def unit(n):
    vectors = RNG.normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_normals_are_area_weighted_means(dtype):
    sheet = waving_grid(n_frames=3)
    positions = np.ascontiguousarray(sheet.vertices, dtype)
    computed = surface_normals(positions, np.ascontiguousarray(sheet.faces, np.int32))
    for frame, normals in zip(positions, computed, strict=True):
        np.testing.assert_allclose(normals, vertex_normals(frame, sheet.faces), atol=1e-12)


def test_normals_of_items_are_sums_over_their_triangles():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 5.0]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]], np.int32)
    normals = surface_normals(corners, faces, np.array([0, 0, 1], np.int32))
    np.testing.assert_array_equal(normals, [[[0, 0, 1], [0, 1, 0]]])


@pytest.mark.parametrize("size", [0.0, 1e-170, 1e160])
def test_normal_is_missing_when_its_length_is_not_representable(size):
    corners = size * np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [7, 7, 7.0]]])
    with np.errstate(over="ignore"):
        normals = surface_normals(corners, np.array([[0, 1, 2]], np.int32))
    assert np.all(normals == 0)


@pytest.mark.parametrize("vertex", [-1, 3])
def test_normals_reject_a_face_with_an_invalid_vertex(vertex):
    with pytest.raises(InvalidInputError, match="normals"):
        surface_normals(np.zeros((1, 3, 3)), np.array([[0, 1, vertex]], np.int32))


def turned(normals, turns):
    """Rotate normals by two numbers each, like the plain reader."""
    each = zip(normals.tolist(), turns.tolist(), strict=True)
    return np.array([predicted.rotated(normal, *by) for normal, by in each])


def test_rotations_reach_the_target_normals():
    normals, targets = unit(2000), unit(2000)
    normals[:500, :2] *= 1e-3  # near the pole, where other tangents are used
    normals[:500] /= np.linalg.norm(normals[:500], axis=1, keepdims=True)
    normals[0], normals[1], normals[2], targets[2] = (0, 0, 1), (0, 0, -1), 0, 0
    reachable = np.einsum("ij,ij->i", normals, targets) > -0.99
    reachable[2] = True
    normals, targets = normals[reachable], targets[reachable]
    rotated = turned(normals, find_rotations(normals, targets))
    np.testing.assert_allclose(rotated, targets, atol=1e-9)


def test_error_of_normals_is_at_most_that_of_rotations():
    normals, targets = unit(1000), unit(1000)
    reachable = np.einsum("ij,ij->i", normals, targets) > -0.99
    normals, turns = (normals[reachable], find_rotations(normals[reachable], targets[reachable]))
    error = 0.01 * RNG.normal(size=turns.shape)
    exact, moved = turned(normals, turns), turned(normals, turns + error)
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(exact - moved, axis=1) / 2, 0, 1))
    assert np.all(angle <= np.linalg.norm(error, axis=1) * (1 + 1e-9))


@pytest.mark.parametrize("target", [(0, 0, 0), (0, 0.01, -1)])
def test_missing_and_opposite_normals_cannot_be_reached(target):
    with pytest.raises(InvalidInputError):
        find_rotations(np.array([[0, 0, 1.0]]), np.array([target], float))
