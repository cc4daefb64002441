import numpy as np
from scipy.sparse.csgraph import dijkstra

from meshreel.geometry.anchors import farthest_points, nested_anchors
from meshreel.geometry.connectivity import adjacency_matrix, component_labels
from sample_meshes import grid_faces, octahedron_faces


def test_each_point_is_farthest_from_those_before_when_checked_by_dijkstra():
    adjacency = adjacency_matrix(grid_faces(8, 9), 72)
    points = farthest_points(adjacency, 6)
    for k in range(1, 6):
        distance = dijkstra(adjacency, indices=points[:k], unweighted=True).min(axis=0)
        assert distance[points[k]] == distance.max()


def test_every_component_gets_a_point_when_there_are_as_many_points():
    faces = np.concatenate([octahedron_faces() + 6 * k for k in range(5)])
    points = farthest_points(adjacency_matrix(faces, 30), 5)
    _, labels = component_labels(faces, 30)
    assert sorted(labels[points]) == [0, 1, 2, 3, 4]


def test_points_are_all_vertices_when_as_many_are_asked_for():
    points = farthest_points(adjacency_matrix(grid_faces(3, 4), 12), 12)
    assert sorted(points) == list(range(12))


def test_nested_sets_keep_their_spacings_when_checked_by_dijkstra():
    adjacency = adjacency_matrix(grid_faces(20, 21), 420)
    sets = nested_anchors(adjacency, np.zeros(420, int), (8, 4, 2), 1)
    known = np.zeros(0, int)
    for members, spacing in zip(sets, (8, 4, 2), strict=True):
        known = np.concatenate([known, members])
        distance = dijkstra(adjacency, indices=known, unweighted=True)
        apart = distance[:, known][~np.eye(len(known), dtype=bool)]
        assert apart.min() >= spacing
        assert distance.min(axis=0).max() < spacing  # maximal: nothing more fits


def test_every_component_gets_its_least_when_it_is_small():
    faces = np.concatenate([grid_faces(20, 21), octahedron_faces() + 420])
    adjacency = adjacency_matrix(faces, 426)
    _, labels = component_labels(faces, 426)
    first, *_ = nested_anchors(adjacency, labels, (8, 3), 4)
    assert np.bincount(labels[first])[1] >= 4


def test_all_vertices_are_taken_when_a_component_has_fewer_than_its_least():
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    sets = nested_anchors(adjacency_matrix(faces, 7), np.array([0, 0, 0, 1, 1, 1, 2]), (5, 2), 4)
    assert sets[0].tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert sets[1].size == 0
