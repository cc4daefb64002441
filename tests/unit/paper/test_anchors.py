import numpy as np
from scipy.sparse.csgraph import dijkstra

from meshreel.geometry.connectivity import adjacency_matrix, component_labels
from meshreel.paper.anchors import farthest_points
from samples.meshes import grid_faces, octahedron_faces


def test_each_point_is_farthest_from_those_before_when_checked_by_dijkstra():
    adjacency = adjacency_matrix(grid_faces(8, 9), 72)
    points = farthest_points(adjacency, 6)
    for k in range(1, 6):
        distance = dijkstra(adjacency.toarray(), indices=points[:k], unweighted=True).min(axis=0)
        assert distance[points[k]] == distance.max()


def test_every_component_gets_a_point_when_there_are_as_many_points():
    faces = np.concatenate([octahedron_faces() + 6 * k for k in range(5)])
    points = farthest_points(adjacency_matrix(faces, 30), 5)
    _, labels = component_labels(faces, 30)
    assert sorted(labels[points]) == [0, 1, 2, 3, 4]


def test_points_are_all_vertices_when_as_many_are_asked_for():
    points = farthest_points(adjacency_matrix(grid_faces(3, 4), 12), 12)
    assert sorted(points) == list(range(12))
