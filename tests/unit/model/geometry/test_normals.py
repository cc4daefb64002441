import numpy as np

from meshreel.model.geometry.normals import face_normals, vertex_normals
from samples.meshes import octahedron_faces


def test_length_of_a_face_normal_is_twice_the_area():
    triangle = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], np.float32)
    np.testing.assert_array_equal(
        face_normals(triangle, np.array([[0, 1, 2]], np.int32)), [[0, 0, 6]]
    )


def test_vertex_normals_of_an_octahedron_point_outward():
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    np.testing.assert_allclose(vertex_normals(corners, octahedron_faces()), corners, atol=1e-15)


def test_vertex_normals_are_zero_when_every_face_is_degenerate():
    corners = np.ones((3, 3))
    assert not vertex_normals(corners, np.array([[0, 1, 1], [2, 2, 2]], np.int32)).any()
