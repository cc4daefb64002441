import numpy as np

from meshreel.model.geometry.connectivity import (
    boundary_edges,
    component_labels,
    isolated_vertices,
    undirected_edges,
)
from samples.meshes import grid_faces, irregular_sequence, octahedron_faces


def test_edges_are_listed_once_when_two_faces_share_one():
    edges = undirected_edges(np.array([[0, 1, 2], [2, 1, 3]], np.int32))
    assert edges.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]


def test_edges_exclude_loops_of_degenerate_faces():
    assert undirected_edges(np.array([[0, 0, 1], [2, 2, 2]], np.int32)).tolist() == [[0, 1]]


def test_isolated_vertices_include_those_of_degenerate_faces():
    faces = np.array([[0, 1, 2], [4, 4, 4]], np.int32)
    assert isolated_vertices(faces, 6).tolist() == [3, 4, 5]


def test_boundary_of_a_grid_is_its_rim():
    assert len(boundary_edges(grid_faces(4, 5))) == 2 * (3 + 4)


def test_boundary_of_a_closed_surface_is_empty():
    assert len(boundary_edges(octahedron_faces())) == 0


def test_components_include_isolated_vertices():
    sequence = irregular_sequence()
    # Vertex 0, the grid, the octahedron, the last vertex.
    labels = component_labels(sequence.faces, sequence.n_verts)
    assert (labels[0], labels.max()) == (0, 3)
    assert (np.diff(np.unique(labels, return_index=True)[1]) > 0).all()
