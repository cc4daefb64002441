"""Normals of a surface, and normals that are turned."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.geometry.normals import vertex_normals
from meshreel.kernel.normals import surface_normals, turned, turns_to
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


def test_turns_lead_to_the_normals_that_are_wanted():
    normals, wanted = unit(20_000), unit(20_000)
    normals[:500, :2] *= 1e-3  # near to the pole, where tangents are others
    normals[:500] /= np.linalg.norm(normals[:500], axis=1, keepdims=True)
    normals[0], normals[1], normals[2], wanted[2] = (0, 0, 1), (0, 0, -1), 0, 0
    can = np.einsum("ij,ij->i", normals, wanted) > -0.99
    can[2] = True
    normals, wanted = normals[can], wanted[can]
    found = np.empty_like(wanted)
    turned(normals, turns_to(normals, wanted), found)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize(("up", "along_x"), [(2.0**-20, -1), (2.0**-20 - 2.0**-53, 1)])
def test_tangents_change_side_where_the_format_says_so(up, along_x):
    side = np.sqrt(up * (2 - up))
    found = np.empty((1, 3))
    turned(np.array([[side, 0, up - 1]]), np.array([[0.5, 0.0]]), found)
    assert found[0, 0] * along_x == pytest.approx(0.5 / (1 + 0.5**2 / 4), abs=0.01)


def test_an_error_of_turns_is_none_larger_of_normals():
    normals, wanted = unit(5000), unit(5000)
    can = np.einsum("ij,ij->i", normals, wanted) > -0.99
    normals, turns = normals[can], turns_to(normals[can], wanted[can])
    error = 0.01 * RNG.normal(size=turns.shape)
    exact, moved = np.empty_like(normals), np.empty_like(normals)
    turned(normals, turns, exact)
    turned(normals, turns + error, moved)
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(exact - moved, axis=1) / 2, 0, 1))
    assert np.all(angle <= np.linalg.norm(error, axis=1) * (1 + 1e-9))


@pytest.mark.parametrize("turns", [(np.inf, 0), (1e200, 1), (np.nan, 0)])
def test_no_normal_is_left_when_turns_are_too_large(turns):
    found = np.empty((1, 3), np.float32)
    turned(np.array([[0.6, 0, 0.8]]), np.array([turns], float), found)
    np.testing.assert_array_equal(found, 0)


@pytest.mark.parametrize("wanted", [(0, 0, 0), (0, 0.01, -1)])
def test_normals_cannot_be_reached_when_they_are_none_or_opposite(wanted):
    with pytest.raises(InvalidInputError):
        turns_to(np.array([[0, 0, 1.0]]), np.array([wanted], float))
