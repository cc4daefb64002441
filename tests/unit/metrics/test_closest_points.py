import numpy as np
import pytest

from meshreel.metrics import closest_points
from meshreel.metrics.closest_points import TriangleTree
from samples.shapes import closest_by_brute_force, torus


def assert_closest(points, corners):
    """The distance, the triangle and the point are those of brute force."""
    result = TriangleTree(corners).closest(points)
    distances = closest_by_brute_force(points, corners)
    least = distances.min(axis=1).astype(float)
    scale = max(1.0, np.abs(points).max())
    np.testing.assert_allclose(
        np.sqrt(result.squared_distances), least, rtol=1e-9, atol=1e-12 * scale
    )
    at_triangle = distances[np.arange(len(points)), result.triangles].astype(float)
    np.testing.assert_allclose(at_triangle, least, rtol=1e-9, atol=1e-12 * scale)
    at_point = np.linalg.norm(points - result.points, axis=1)
    np.testing.assert_allclose(at_point, least, rtol=1e-9, atol=1e-12 * scale)


def triangles(kind, rng):
    """Corners of triangles, of shape (N, 3, 3)."""
    start, along = rng.normal(size=(2, 100, 3))
    if kind == "sizes that differ":
        return start[:, None] + 10.0 ** rng.uniform(-4, 1, (100, 1, 1)) * rng.normal(
            size=(100, 3, 3)
        )
    if kind == "slivers":
        bent = start + 0.4 * along + 1e-6 * rng.normal(size=(100, 3))
        return np.stack([start, start + along, bent], axis=1)
    if kind == "without area":
        lines = np.stack([start, along, 0.75 * start + 0.25 * along], axis=1)
        return np.concatenate([lines, np.repeat(rng.normal(size=(20, 1, 3)), 3, axis=1)])
    return rng.normal(size=(kind, 3, 3))


@pytest.mark.parametrize("kind", [1, 2, 3, 17, 300, "sizes that differ", "slivers", "without area"])
def test_closest_points_are_exact_for_triangles_of_all_kinds(kind, rng):
    assert_closest(rng.normal(size=(200, 3)), triangles(kind, rng))


@pytest.mark.slow
def test_closest_points_are_exact_for_points_on_far_from_and_near_a_surface(rng):
    vertices, faces = torus(12, 20)
    near = vertices[faces].mean(axis=1) + 0.01 * rng.normal(size=(len(faces), 3))
    points = np.concatenate([vertices, near, 3 * near, 1000 * near[:20], np.zeros((1, 3))])
    assert_closest(points, vertices[faces])


def test_closest_points_of_an_equidistant_point_are_exact_when_pairs_exceed_memory(
    rng, monkeypatch
):
    monkeypatch.setattr(closest_points, "MAX_PAIRS", 64)
    vertices = rng.normal(size=(600, 3))
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    assert_closest(1e-3 * rng.normal(size=(50, 3)), vertices.reshape(200, 3, 3))


def test_closest_points_do_not_depend_on_how_many_are_searched_at_once(rng, monkeypatch):
    points, corners = rng.normal(size=(500, 3)), rng.normal(size=(100, 3, 3))
    whole = TriangleTree(corners).closest(points)
    monkeypatch.setattr(closest_points, "POINTS_AT_ONCE", 16)
    for one, other in zip(whole, TriangleTree(corners).closest(points), strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_points_have_no_closest_points(rng):
    result = TriangleTree(rng.normal(size=(5, 3, 3))).closest(np.empty((0, 3)))
    assert [len(values) for values in result] == [0, 0, 0]
