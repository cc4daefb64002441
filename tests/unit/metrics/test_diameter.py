import numpy as np
import pytest
from scipy.spatial.distance import pdist

from meshreel.metrics.diameter import diameter


def clouds(rng):
    points = rng.normal(size=(300, 3))
    sphere = points / np.linalg.norm(points, axis=1, keepdims=True)
    return {
        "solid": points,
        "lattice": np.round(points),
        "sphere": sphere,
        "half sphere": np.abs(sphere),
        "planar": points * [1, 1, 0],
        "tilted plane": points @ [[1, 2, 3], [2, -1, 0.5], [3, 1, 3.5]] * [1, 1, 0],
        "circle": sphere[:, :1] * [0, 0, 0] + np.column_stack(
            [np.cos(points[:, 0]), np.sin(points[:, 0]), 0 * points[:, 0]]),
        "collinear": points[:, :1] * [1, 2, 3],
        "nearly collinear": points * [1, 1e-9, 1e-12],
        "two clusters": points * 1e-8 + (np.arange(300) % 2)[:, None],
        "repeated": np.repeat(points[:5], 60, axis=0),
        "tiny": points * 1e-140,
        "tetrahedron": np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
        "two points": points[:2],
    }  # fmt: skip


@pytest.mark.parametrize("kind", clouds(np.random.default_rng()))
def test_diameter_equals_the_largest_distance_of_two_points(kind, rng):
    points = clouds(rng)[kind]
    assert diameter(points) == pytest.approx(pdist(points).max(), rel=1e-14, abs=0)


@pytest.mark.slow
def test_diameter_of_many_small_clouds_is_exact(rng):
    for n_points in rng.integers(2, 20, size=300):
        points = rng.normal(size=(n_points, 3)) * 10.0 ** rng.integers(-3, 1, size=3)
        assert diameter(points) == pytest.approx(pdist(points).max(), rel=1e-14, abs=0)


@pytest.mark.parametrize("n_points", [1, 2, 50])
def test_diameter_of_coincident_points_is_zero(n_points):
    assert diameter(np.full((n_points, 3), 0.1)) == 0


def test_diameter_of_points_on_a_sphere_is_exact(rng):
    directions = rng.normal(size=(10_000, 3))
    half = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert diameter(np.concatenate([half, -half])) == pytest.approx(2, rel=1e-14)
