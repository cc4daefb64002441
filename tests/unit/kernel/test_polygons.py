"""Polygons are cut into triangles that cover them once, and are recovered from them."""

from itertools import pairwise

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.kernel.polygons import triangle_corners, triangulate
from meshreel.model.geometry.polygons import join_triangles

SQUARE_IN_SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]


def flat(outline):
    return np.column_stack([outline, np.zeros(len(outline))]).astype(float)


def star(rng, n):
    """Return a polygon around the origin with concave corners, shape (n, 2)."""
    angles = 2 * np.pi * (np.arange(n) + rng.random(n)) / n
    return (0.05 + rng.random(n) ** 2)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def fans(sizes, corners):
    """Return the triangles around the first corner of each polygon, of shape (M, 3)."""
    polygons = np.split(np.asarray(corners), np.cumsum(sizes)[:-1])
    return [[polygon[0], *side] for polygon in polygons for side in pairwise(polygon[1:])]


def outline_area(outline):
    x, y = np.asarray(outline, float).T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


def total_area(vertices, faces):
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def cut(vertices, sizes, corners):
    """Return triangles and overlaps after checking that the corners are recovered."""
    faces, n_overlapping = triangulate(sizes, corners, vertices)
    assert join_triangles(sizes, faces).tolist() == list(corners)
    return faces, n_overlapping


@pytest.mark.parametrize("seed", range(20))
def test_triangles_cover_concave_polygons_once(seed):
    rng = np.random.default_rng(seed)
    outline = star(rng, int(rng.integers(4, 40)))
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    vertices = flat(outline) @ axes + 100 * rng.normal(size=3)
    corners = np.roll(np.arange(len(outline))[:: (-1) ** seed], int(rng.integers(len(outline))))
    faces, n_overlapping = cut(vertices, np.array([len(corners)]), corners)
    assert n_overlapping == 0
    assert total_area(vertices, faces) == pytest.approx(outline_area(outline), rel=1e-9)


def test_polygons_without_reversed_triangles_become_fans():
    rng = np.random.default_rng(0)
    sizes = rng.integers(3, 9, 200)
    angles = np.concatenate([2 * np.pi * np.arange(n) / n for n in sizes])
    corners = rng.permutation(len(angles))
    vertices = np.empty((len(angles), 3))
    vertices[corners] = flat(np.column_stack([np.cos(angles), np.sin(angles)]))
    faces, n_overlapping = cut(vertices, sizes, corners)
    assert n_overlapping == 0
    assert faces.tolist() == fans(sizes, corners)


def test_a_hole_joined_to_the_outline_is_left_open():
    vertices = flat([*SQUARE_IN_SQUARE[:4], *SQUARE_IN_SQUARE[5:9]])
    corners = np.array([0, 1, 2, 3, 0, 4, 5, 6, 7, 4])
    faces, n_overlapping = cut(vertices, np.array([10]), corners)
    assert n_overlapping == 0
    assert total_area(vertices, faces) == pytest.approx(12)


@pytest.mark.parametrize(
    "outline",
    [[(0, 0), (2, 2), (2, 0), (0, 2)], [(0, 0), (3, 0), (1, 2), (1, -1), (3, 1)]],
    ids=["bow", "crossed"],
)
def test_polygons_that_cross_themselves_are_counted(outline):
    vertices = flat([*outline, (5, 0), (6, 0), (5, 1)])
    corners = np.arange(len(vertices))
    _, n_overlapping = cut(vertices, np.array([len(outline), 3]), corners)
    assert n_overlapping == 1


def test_corners_are_numbered_along_the_outline_of_adjoining_triangles():
    # 0 1 2 gains 3 behind the side 2 0, then 4 in the side 2 3, then 5 in the first side, 0 1.
    triangles = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4], [1, 0, 5], [7, 8, 9]])
    corners = [[0, 2, 3], [0, 3, 5], [5, 3, 4], [2, 0, 1], [6, 7, 8]]
    assert triangle_corners(np.array([6, 3]), triangles).tolist() == corners
    assert join_triangles(np.array([6, 3]), triangles).tolist() == [0, 5, 1, 2, 4, 3, 7, 8, 9]


@pytest.mark.parametrize("second", [[1, 2, 3], [0, 1, 3], [4, 5, 6]])
def test_triangles_of_a_polygon_that_do_not_adjoin_are_refused(second):
    with pytest.raises(InvalidInputError, match="do not adjoin"):
        triangle_corners(np.array([4]), np.array([[0, 1, 2], second]))
