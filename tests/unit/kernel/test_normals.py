"""Normals of a surface, and normals that are turned."""

import numpy as np
import pytest

from conformance import predicted
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import find_rotations, surface_normals
from meshreel.model.geometry.normals import vertex_normals
from samples.meshes import waving_grid

RNG = np.random.default_rng(21)


def unit(n):
    found = RNG.normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_normals_are_area_weighted_means(dtype):
    sheet = waving_grid(n_frames=3)
    positions = np.ascontiguousarray(sheet.vertices, dtype)
    found = surface_normals(positions, np.ascontiguousarray(sheet.faces, np.int32))
    for frame, normals in zip(positions, found, strict=True):
        np.testing.assert_allclose(normals, vertex_normals(frame, sheet.faces), atol=1e-12)


def test_normals_of_items_are_sums_over_their_triangles():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 5.0]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]], np.int32)
    found = surface_normals(corners, faces, np.array([0, 0, 1], np.int32))
    np.testing.assert_array_equal(found, [[[0, 0, 1], [0, 1, 0]]])


@pytest.mark.parametrize("size", [0.0, 1e-170, 1e160])
def test_there_is_no_normal_where_no_number_tells_its_length(size):
    corners = size * np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [7, 7, 7.0]]])
    with np.errstate(over="ignore"):
        found = surface_normals(corners, np.array([[0, 1, 2]], np.int32))
    assert np.all(found == 0)


@pytest.mark.parametrize("vertex", [-1, 3])
def test_a_face_is_refused_when_it_has_no_such_vertex(vertex):
    with pytest.raises(InvalidInputError, match="normals"):
        surface_normals(np.zeros((1, 3, 3)), np.array([[0, 1, vertex]], np.int32))


def turned(normals, turns):
    """Normals, each turned by two numbers, as the plain reader does it."""
    each = zip(normals.tolist(), turns.tolist(), strict=True)
    return np.array([predicted.rotated(normal, *by) for normal, by in each])


def test_turns_lead_to_the_normals_that_are_wanted():
    normals, wanted = unit(2000), unit(2000)
    normals[:500, :2] *= 1e-3  # near to the pole, where tangents are others
    normals[:500] /= np.linalg.norm(normals[:500], axis=1, keepdims=True)
    normals[0], normals[1], normals[2], wanted[2] = (0, 0, 1), (0, 0, -1), 0, 0
    can = np.einsum("ij,ij->i", normals, wanted) > -0.99
    can[2] = True
    normals, wanted = normals[can], wanted[can]
    found = turned(normals, find_rotations(normals, wanted))
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_an_error_of_turns_is_none_larger_of_normals():
    normals, wanted = unit(1000), unit(1000)
    can = np.einsum("ij,ij->i", normals, wanted) > -0.99
    normals, turns = normals[can], find_rotations(normals[can], wanted[can])
    error = 0.01 * RNG.normal(size=turns.shape)
    exact, moved = turned(normals, turns), turned(normals, turns + error)
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(exact - moved, axis=1) / 2, 0, 1))
    assert np.all(angle <= np.linalg.norm(error, axis=1) * (1 + 1e-9))


@pytest.mark.parametrize("wanted", [(0, 0, 0), (0, 0.01, -1)])
def test_normals_cannot_be_reached_when_they_are_none_or_opposite(wanted):
    with pytest.raises(InvalidInputError):
        find_rotations(np.array([[0, 0, 1.0]]), np.array([wanted], float))
