import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import describe_triangles, polygon_mesh, reversed_corners


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        ([3, 3], ""),
        ([3, 4, 4], "triangulated 2 quads, the same way in every frame"),
        ([5, 4], "triangulated 2 polygons, the same way in every frame"),
    ],
)
def test_describe_triangles_counts_triangulated_faces(counts, expected):
    assert describe_triangles(np.array(counts)) == expected


def test_error_names_a_face_with_two_corners():
    with pytest.raises(FormatError, match=r"face 1: a face needs at least three corners; got 2"):
        polygon_mesh(np.zeros((4, 3)), np.array([3, 2]), np.array([0, 1, 2, 0, 1]))


@pytest.mark.parametrize("index", [4, -1, 1 << 40])
def test_error_names_face_and_index_out_of_range(index):
    with pytest.raises(FormatError, match=rf"face 1: uses vertex {index}; .* 0\.\.3"):
        polygon_mesh(np.zeros((4, 3)), np.array([3, 3]), np.array([0, 1, 2, 0, 1, index]))


@pytest.mark.parametrize(("n_verts", "n_faces"), [(0, 0), (3, 0), (0, 1)])
def test_mesh_without_vertices_or_faces_is_rejected(n_verts, n_faces):
    with pytest.raises(FormatError, match=f"holds {n_verts} vertices and {n_faces} face"):
        polygon_mesh(np.zeros((n_verts, 3)), np.full(n_faces, 3), np.arange(3 * n_faces))


@pytest.mark.parametrize(
    ("keeps_first", "expected"), [(False, [2, 1, 0, 6, 5, 4, 3]), (True, [0, 2, 1, 3, 6, 5, 4])]
)
def test_reversed_corners_reverses_each_face_when_faces_differ(keeps_first, expected):
    order = reversed_corners(np.array([3, 4], np.int32), keeps_first=keeps_first)
    np.testing.assert_array_equal(order, expected)


@pytest.mark.parametrize("keeps_first", [False, True])
@pytest.mark.parametrize("counts", [[3, 5, 4], [], [0, 3, 0]])
def test_reversed_corners_restores_the_order_when_applied_twice(counts, keeps_first):
    order = reversed_corners(np.array(counts, np.int64), keeps_first=keeps_first)
    np.testing.assert_array_equal(order[order], np.arange(sum(counts)))
