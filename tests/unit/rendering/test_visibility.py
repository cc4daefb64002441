import numpy as np
import pytest

from meshreel.rendering.camera import Camera
from meshreel.rendering.visibility import nearness, visible_faces


def flat_camera(width, height):
    return Camera(np.zeros(3), np.eye(3), 1.0, width, height)


def seen(points, faces, *, depths=None, size=(100, 80)):
    depths = np.ones(len(points)) if depths is None else np.asarray(depths, float)
    camera = flat_camera(*size)
    size = camera.width, camera.height
    return visible_faces(np.asarray(points, float), nearness(depths), np.asarray(faces), size)


@pytest.mark.parametrize("order", [[0, 1, 2], [0, 2, 1], [2, 0, 1]])
def test_visible_faces_covers_the_area_of_a_triangle(order):
    points = np.array([[3.2, 5.1], [95.7, 12.3], [40.4, 77.9]])
    ab, ac = points[1] - points[0], points[2] - points[0]
    area = abs(ab[0] * ac[1] - ab[1] * ac[0]) / 2
    assert (seen(points, [order]) == 0).sum() == pytest.approx(area, rel=0.02)


def test_visible_faces_covers_each_pixel_of_adjacent_faces_once():
    """Irregular faces tile the whole picture: their areas add up to it."""
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(np.linspace(0, 100, 12), np.linspace(0, 80, 9)), axis=-1)
    grid[1:-1, 1:-1] += rng.uniform(-3, 3, (7, 10, 2))
    vertex = np.arange(108).reshape(9, 12)
    a, b, c, d = vertex[:-1, :-1], vertex[1:, :-1], vertex[1:, 1:], vertex[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([c, d, a], -1).reshape(-1, 3)]
    )
    points = grid.reshape(-1, 2)
    assert sum((seen(points, [face]) == 0).sum() for face in faces) == 8000
    assert (seen(points, faces) >= 0).all()


def test_visible_faces_of_crossing_faces_changes_at_their_intersection():
    """Along x one face recedes and the other comes nearer: equal depth, in 1/z, at x = 50."""
    points = [[0, -500], [100, 40], [0, 580], [100, -500], [0, 40], [100, 580]]
    ids = seen(points, [[0, 1, 2], [3, 4, 5]], depths=[1, 3, 1, 1, 3, 1]).reshape(80, 100)
    assert (ids[:, :50] == 0).all()
    assert (ids[:, 50:] == 1).all()


def test_visible_faces_fills_the_picture_with_a_huge_face():
    assert (seen([[-1e9, -1e9], [1e9, -1e9], [0, 1e9]], [[0, 1, 2]]) == 0).all()


@pytest.mark.parametrize(
    "points",
    [
        [[5, 5], [5, 5], [5, 5]],
        [[5, 5], [50, 50], [95, 95]],
        [[5, 7.5], [50, 7.5], [95, 7.5]],
        [[200, 5], [300, 5], [200, 60]],
        [[-20, 5], [-10, 5], [-20, 60]],
        [[5, 200], [50, 200], [5, 260]],
    ],
)
def test_visible_faces_ignores_degenerate_and_outside_faces(points):
    assert (seen(points, [[0, 1, 2]]) == -1).all()


def test_visible_faces_omits_faces_that_reach_behind_the_eye():
    points = [[0, 0], [99, 0], [0, 79], [99, 79]]
    ids = seen(points, [[0, 1, 2], [1, 2, 3]], depths=[-1, 1, 1, 1])
    assert set(ids) == {-1, 1}


def test_visible_faces_is_empty_behind_the_eye():
    assert (seen([[0, 0], [99, 0], [0, 79]], [[0, 1, 2]], depths=[-1, -2, 0]) == -1).all()


def test_visible_faces_agrees_with_a_plain_loop():
    rng = np.random.default_rng(8)
    points, depths = rng.uniform(-20, 120, (60, 2)), rng.uniform(1, 5, 60)
    faces = np.arange(60).reshape(20, 3)
    x, y = np.meshgrid(np.arange(100) + 0.5, np.arange(80) + 0.5)
    best, expected = np.zeros((80, 100)), np.full((80, 100), -1)
    for number, face in enumerate(faces):
        matrix = np.vstack([points[face].T, np.ones(3)])
        weights = np.linalg.solve(matrix, np.stack([x, y, np.ones_like(x)]).reshape(3, -1))
        near = (weights * (1 / depths[face])[:, None]).sum(axis=0).reshape(x.shape)
        inside = (weights >= 0).all(axis=0).reshape(x.shape) & (near > best)
        best[inside], expected[inside] = near[inside], number
    ids = seen(points, faces, depths=depths).reshape(80, 100)
    assert (ids == expected).mean() > 0.999
