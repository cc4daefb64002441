"""Closest points of triangle meshes, compared with brute force in extended precision."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.kernel.closest import TriangleTree
from samples.shapes import closest_by_brute_force, torus


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def soup(corners):
    """Vertices and faces of triangles that share no vertex."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def assert_closest(points, vertices, faces, tolerance=1e-14):
    """Distances, faces, points and weights are those of brute force, up to rounding."""
    result = TriangleTree(vertices, faces).closest(points)
    distances = closest_by_brute_force(points, vertices[faces])
    least = distances.min(axis=1).astype(float)
    at_face = distances[np.arange(len(points)), result.faces].astype(float)
    at_point = np.linalg.norm(points - result.points, axis=1)
    weighted = np.einsum("nk,nkc->nc", result.weights, vertices[faces[result.faces]])
    scale = np.abs(points).max() + np.abs(vertices).max()
    for found in (result.distances, at_face, at_point):
        np.testing.assert_allclose(found, least, rtol=1e-14, atol=tolerance * scale)
    np.testing.assert_allclose(weighted, result.points, rtol=0, atol=1e-15 * scale)
    assert result.weights.min(initial=0) >= 0
    np.testing.assert_allclose(result.weights.sum(axis=1), 1, rtol=1e-15)


def triangles(kind, rng):
    """Corners of triangles, of shape (N, 3, 3)."""
    start, along = rng.normal(size=(2, 100, 3))
    if kind == "sizes that differ":
        sizes = 10.0 ** rng.uniform(-4, 1, (100, 1, 1))
        return start[:, None] + sizes * rng.normal(size=(100, 3, 3))
    if kind == "slivers":
        heights = 10.0 ** rng.uniform(-12, -3, (100, 1))
        bent = start + 0.4 * along + heights * rng.normal(size=(100, 3))
        return np.stack([start, start + along, bent], axis=1)
    if kind == "without area":
        lines = np.stack([start, along, 0.75 * start + 0.25 * along], axis=1)
        return np.concatenate([lines, np.repeat(rng.normal(size=(20, 1, 3)), 3, axis=1)])
    if kind == "equal":
        return np.repeat(rng.normal(size=(1, 3, 3)), 100, axis=0)
    if kind == "on a plane":
        return np.round(rng.normal(size=(300, 3, 3)), 1) * [1, 1, 0]
    return rng.normal(size=(kind, 3, 3))


KINDS = "sizes that differ", "slivers", "without area", "equal", "on a plane"


@pytest.mark.parametrize("kind", [1, 2, 4, 5, 32, 33, 300, *KINDS])
def test_closest_points_are_exact_for_triangles_of_all_kinds(kind, rng):
    corners = triangles(kind, rng)
    near = corners.mean(axis=1) + 1e-3 * rng.normal(size=(len(corners), 3))
    vertices, faces = soup(corners)
    tolerance = 1e-8 if kind == "slivers" else 1e-14
    assert_closest(np.concatenate([rng.normal(size=(99, 3)), near]), vertices, faces, tolerance)


def test_closest_points_are_exact_on_far_from_and_near_a_surface(rng):
    vertices, faces = torus(12, 20)
    near = vertices[faces].mean(axis=1) + 0.01 * rng.normal(size=(len(faces), 3))
    points = np.concatenate([vertices, near, 3 * near, 1000 * near[:20], np.zeros((1, 3))])
    assert_closest(points, vertices, faces)


@pytest.mark.parametrize(("size", "offset"), [(1, 1e6), (1e-18, 0), (1e18, 0), (1, 1e15)])
def test_distances_keep_their_digits_at_any_offset_and_size(size, offset, rng):
    corners = size * rng.normal(size=(200, 3, 3)) + offset
    points = size * rng.normal(size=(100, 3)) + offset
    found = TriangleTree(*soup(corners)).closest(points).distances
    least = closest_by_brute_force(points - offset, corners - offset).min(axis=1).astype(float)
    np.testing.assert_allclose(found, least, rtol=1e-14, atol=1e-14 * size)


def test_lowest_of_equally_close_faces_is_found(rng):
    corners = np.round(rng.normal(size=(50, 3, 3)), 1)
    vertices, faces = soup(np.concatenate([corners] * 3))
    points = rng.normal(size=(200, 3))
    found = TriangleTree(vertices, faces).closest(points)
    alone = TriangleTree(*soup(corners)).closest(points)
    for values, others in zip(found, alone, strict=True):
        np.testing.assert_array_equal(values, others)


def test_result_does_not_depend_on_the_order_of_points(rng):
    vertices, faces = torus(12, 20)
    tree = TriangleTree(vertices, faces)
    points = np.concatenate([vertices, vertices[faces].mean(axis=1), rng.normal(size=(99, 3))])
    order = rng.permutation(len(points))
    found, shuffled = tree.closest(points), tree.closest(points[order])
    for values, others in zip(found, shuffled, strict=True):
        np.testing.assert_array_equal(values[order], others)
    each = [tree.closest(point[None]).faces[0] for point in points]
    np.testing.assert_array_equal(each, found.faces)


def test_only_faces_of_similar_normals_in_reach_count(rng):
    corners = rng.normal(size=(60, 3, 3))
    corners[:3, 2] = corners[:3, 0]  # without area
    points, cosine, reach = rng.normal(size=(200, 3)), 0.7, 0.6
    normals = rng.normal(size=points.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = TriangleTree(*soup(corners)).closest(points, normals / cosine, reach)

    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    counts = normals @ across.T > cosine * lengths
    distances = np.where(counts, closest_by_brute_force(points, corners), np.inf).astype(float)
    has_face = distances.min(axis=1) <= reach
    assert 20 < has_face.sum() < 180
    np.testing.assert_array_equal(found.faces >= 0, has_face)
    np.testing.assert_array_equal(found.faces[has_face], distances[has_face].argmin(axis=1))
    np.testing.assert_allclose(found.distances[has_face], distances[has_face].min(axis=1))
    assert np.isinf(found.distances[~has_face]).all()


def test_no_points_have_no_closest_points():
    result = TriangleTree(*torus(4, 4)).closest(np.empty((0, 3)))
    assert [len(values) for values in result] == [0, 0, 0, 0]


@pytest.mark.parametrize("faces", [np.empty((0, 3), int), [[0, 1, 3]], [[0, -1, 2]]])
def test_faces_must_exist(faces):
    with pytest.raises(InvalidInputError, match="faces"):
        TriangleTree(np.eye(3), np.array(faces))
