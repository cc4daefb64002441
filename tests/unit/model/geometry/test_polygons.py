import numpy as np

from meshreel.model.geometry.polygons import fan_corners, join_fans, triangulate_fans


def test_triangulate_fans_keeps_faces_when_all_are_triangles():
    corners = np.array([0, 1, 2, 2, 1, 3])
    assert triangulate_fans(np.array([3, 3]), corners).tolist() == [[0, 1, 2], [2, 1, 3]]


def test_triangulate_fans_keeps_face_order_when_sizes_are_mixed():
    counts = np.array([3, 5, 4])
    corners = np.array([9, 8, 7, 0, 1, 2, 3, 4, 5, 6, 7, 8])
    expected = [[9, 8, 7], [0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7], [5, 7, 8]]
    assert triangulate_fans(counts, corners).tolist() == expected


def test_join_fans_inverts_triangulate_fans():
    rng = np.random.default_rng(0)
    sizes = rng.integers(3, 9, 200)
    corners = rng.integers(0, 50, sizes.sum())
    assert join_fans(sizes, triangulate_fans(sizes, corners)).tolist() == corners.tolist()


def test_fan_corners_are_polygon_corners_when_sizes_are_mixed():
    sizes, corners = np.array([3, 5, 4]), np.arange(100, 112)
    assert corners[fan_corners(sizes)].tolist() == triangulate_fans(sizes, corners).tolist()
