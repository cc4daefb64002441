import numpy as np

from meshreel.paper.adjacency import adjacency_matrix, component_labels
from samples.meshes import irregular_sequence


def test_adjacency_is_binary_when_faces_are_duplicated():
    faces = np.array([[0, 1, 2], [0, 1, 2]], np.int32)
    expected = np.ones((3, 3)) - np.eye(3)
    np.testing.assert_array_equal(adjacency_matrix(faces, 3).toarray(), expected)


def test_components_include_isolated_vertices():
    sequence = irregular_sequence()
    # Vertex 0, the grid, the octahedron, the last vertex.
    assert component_labels(sequence.faces, sequence.n_verts)[0] == 4
