import numpy as np
import pytest

from meshreel.metrics import surface_samples
from meshreel.metrics.surface_samples import (
    projected_area,
    sample_on_grid,
    sample_uniformly,
    triangle_set,
)
from samples.shapes import cube, square, torus


def triangles_of(vertices, faces):
    return triangle_set(np.asarray(vertices, float), np.asarray(faces), 1e-14)


def on_cube(points):
    return np.isclose(np.abs(points - 0.5).max(axis=1), 0.5)


def test_triangles_without_area_and_isolated_vertices_are_omitted():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9]]
    triangles = triangles_of(vertices, [[0, 1, 3], [0, 1, 2], [1, 1, 2]])
    assert triangles.n_degenerate == 2
    np.testing.assert_array_equal(triangles.vertices, vertices[:3])
    np.testing.assert_array_equal(triangles.normals, [[0, 0, 1]])


@pytest.mark.parametrize("n_samples", [1, 10, 4000])
def test_samples_per_triangle_are_proportional_to_area(rng, n_samples):
    corners = rng.normal(size=(50, 3, 3))
    triangles = triangles_of(corners.reshape(-1, 3), np.arange(150).reshape(50, 3))
    normals = sample_uniformly(triangles, n_samples).normals
    counts = np.isclose(normals @ triangles.normals.T, 1).sum(axis=0)
    shares = n_samples * triangles.areas / triangles.areas.sum()
    assert counts.sum() == n_samples
    assert np.abs(counts - shares).max() < 1 + 1e-9


def test_samples_fill_a_triangle_evenly():
    points = sample_uniformly(
        triangles_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), 4000
    ).points
    x, y = points[:, 0], points[:, 1]
    assert x.min() >= 0
    assert y.min() >= 0
    assert (x + y).max() <= 1
    # Moments of the triangle; random samples would be off by 0.004.
    for values, moment in ((x, 1 / 3), (y, 1 / 3), (x * x, 1 / 6), (x * y, 1 / 12)):
        assert values.mean() == pytest.approx(moment, abs=1e-3)


def test_samples_are_the_same_in_every_call_and_use_no_global_random_state():
    triangles, state = triangles_of(*torus(6, 9)), np.random.get_state()[1].copy()  # noqa: NPY002
    first, second = (sample_uniformly(triangles, 1000).points for _ in range(2))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002


@pytest.mark.parametrize("cells_at_once", [1, 40, 1 << 20])
def test_grid_meets_a_square_once_at_each_line(monkeypatch, cells_at_once):
    monkeypatch.setattr(surface_samples, "CELLS_PER_BATCH", cells_at_once)
    result = sample_on_grid(triangles_of(*square(0.25, n=4)), np.zeros(3), 0.1)
    lines = np.unique(np.rint(result.points * 10), axis=0)
    assert len(result.points) == len(lines) == 11 * 11
    np.testing.assert_allclose(
        result.points[:, :2] * 10, np.rint(result.points[:, :2] * 10), atol=1e-9
    )
    np.testing.assert_allclose(result.points[:, 2], 0.25)
    np.testing.assert_array_equal(result.normals, np.tile([0.0, 0.0, 1.0], (121, 1)))


def test_grid_follows_the_axis_closest_to_the_normal():
    vertices, faces = square()
    tilted = np.stack([vertices[:, 0], vertices[:, 1], 0.5 * vertices[:, 0]], axis=1)
    for axes in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        points = sample_on_grid(triangles_of(tilted[:, axes], faces), np.zeros(3), 0.1).points
        x, y, z = points[:, np.argsort(axes)].T
        assert len(points) == 121
        np.testing.assert_allclose(z, 0.5 * x, atol=1e-12)
        np.testing.assert_allclose([x * 10, y * 10], np.rint([x * 10, y * 10]), atol=1e-9)


def test_grid_meets_corners_and_edges_of_a_cube_once():
    points = sample_on_grid(triangles_of(*cube()), np.zeros(3), 0.25).points
    assert len(points) == 5**3 - 3**3
    assert on_cube(points).all()


@pytest.mark.slow
def test_projected_area_predicts_the_number_of_grid_points():
    triangles = triangles_of(*torus())
    low, step = triangles.vertices.min(axis=0), 0.005
    n_points = len(sample_on_grid(triangles, low, step).points)
    assert n_points == pytest.approx(projected_area(triangles) / step**2, rel=0.01)


def test_surface_between_the_lines_is_sampled_at_its_centroids():
    triangles = triangles_of(*cube())
    result = sample_on_grid(triangles, np.full(3, -5.0), 10.0)
    np.testing.assert_allclose(
        np.sort(result.points, axis=0), np.sort(triangles.corners.mean(axis=1), axis=0)
    )
