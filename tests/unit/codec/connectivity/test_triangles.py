import numpy as np
import pytest

from meshreel.codec.connectivity.triangles import (
    lowest_rotation,
    rotate_corners,
    sorted_order,
    twin_sides,
)


@pytest.mark.parametrize("face", [[3, 1, 2], [5, 9, 7], [1, 1, 0], [0, 0, 1], [4, 4, 4]])
def test_lowest_rotation_does_not_depend_on_the_first_corner(face):
    turned = np.array([np.roll(face, by) for by in range(3)])
    lowest, _ = lowest_rotation(turned, 10)
    assert lowest.tolist() == [min(turned.tolist())] * 3


def test_lowest_rotation_distinguishes_mirrored_faces():
    lowest, _ = lowest_rotation(np.array([[2, 0, 1], [1, 0, 2]]), 3)
    assert lowest.tolist() == [[0, 1, 2], [0, 2, 1]]


def test_rotate_corners_inverts_lowest_rotation(mesh):
    faces, n_verts = mesh
    lowest, front = lowest_rotation(faces, n_verts)
    np.testing.assert_array_equal(rotate_corners(lowest, (-front) % 3), faces)


def test_sorted_order_is_lexicographic_and_stable():
    faces = np.array([[1, 2, 3], [0, 5, 2], [1, 2, 3], [0, 5, 1], [0, 2, 9]])
    assert sorted_order(faces, 10).tolist() == [4, 3, 1, 0, 2]


def test_twin_sides_pair_the_sides_of_a_shared_edge_in_either_direction():
    # Side 1 of the first face runs 1 -> 2, side 0 of the second 2 -> 1.
    assert twin_sides(np.array([[0, 1, 2], [2, 1, 3]]), 4).tolist() == [0, 3, 2, 1, 4, 5]
    assert twin_sides(np.array([[0, 1, 2], [1, 2, 3]]), 4)[1] == 3


def test_twin_sides_of_any_mesh_share_an_edge_and_refer_to_each_other(mesh):
    faces, n_verts = mesh
    twins = twin_sides(faces, n_verts)
    ends = np.sort(np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()], 1), axis=1)
    np.testing.assert_array_equal(twins[twins], np.arange(len(twins)))
    np.testing.assert_array_equal(ends[twins], ends)


def test_every_side_of_a_closed_surface_has_a_twin(meshes):
    twins = twin_sides(*meshes["torus"])
    assert (twins != np.arange(len(twins))).all()
