"""Choice and validation of anchors."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import component_labels
from meshreel.paper.anchors import check_anchors, choose_anchors, farthest_points
from meshreel.paper.laplacian import adjacency_matrix
from samples.meshes import grid_faces, octahedron_faces


def test_each_point_is_farthest_from_earlier_ones_by_dijkstra():
    adjacency = adjacency_matrix(grid_faces(8, 9), 72)
    points = farthest_points(adjacency, 6)
    for k in range(1, 6):
        distance = dijkstra(adjacency.toarray(), indices=points[:k], unweighted=True).min(axis=0)
        assert distance[points[k]] == distance.max()


def test_every_component_gets_a_point():
    faces = np.concatenate([octahedron_faces() + 6 * k for k in range(5)])
    points = farthest_points(adjacency_matrix(faces, 30), 5)
    labels = component_labels(faces, 30)
    assert sorted(labels[points]) == [0, 1, 2, 3, 4]


def test_as_many_points_as_vertices_are_all_vertices():
    points = farthest_points(adjacency_matrix(grid_faces(3, 4), 12), 12)
    assert sorted(points) == list(range(12))


SHEETS = np.concatenate([grid_faces(6, 7), grid_faces(4, 5) + 42 + 3])
"""Of 42 and of 20 vertices; three between them have no edge."""


@pytest.mark.parametrize("rng", [None, np.random.default_rng(3)], ids=["spread", "random"])
@pytest.mark.parametrize(("share", "n_anchors"), [(0.0, 2), (0.01, 2), (0.1, 7), (0.5, 31)])
def test_anchors_are_the_requested_share_in_ascending_order(share, n_anchors, rng):
    anchors = choose_anchors(SHEETS, 65, share, rng)
    assert len(anchors) == n_anchors
    assert np.all(np.diff(anchors) > 0)
    assert not set(anchors) & {42, 43, 44}
    assert anchors[0] < 42
    assert anchors[-1] >= 45


@pytest.mark.parametrize("rng", [None, np.random.default_rng(3)], ids=["spread", "random"])
def test_share_1_selects_all_vertices_with_edges(rng):
    expected = [*range(42), *range(45, 65)]
    assert choose_anchors(SHEETS, 65, 1.0, rng).tolist() == expected


def test_ties_of_farthest_points_go_to_the_lowest_vertex():
    assert farthest_points(adjacency_matrix(octahedron_faces(), 6), 2)[0] == 0
    ring = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    assert farthest_points(adjacency_matrix(ring, 5), 3).tolist() == [0, 2, 1]


def test_given_anchors_are_sorted():
    assert check_anchors([64, 0, 20], SHEETS, 65).tolist() == [0, 20, 64]


@pytest.mark.parametrize(
    ("anchors", "message"),
    [
        ([], r"anchors must be vertices 0\.\.64, at least one; got \[\]"),
        ([-1, 50], r"0\.\.64, at least one; got \[-1, 50\]"),
        ([0, 65], r"0\.\.64, at least one; got \[0, 65\]"),
        ([0, 50, 50], "lists vertex 50 twice"),
        ([0, 43, 50], "vertex 43 has no edge"),
        ([0, 1], "1 connected components have no anchor, for example the component of vertex 45"),
        ([50], "1 connected components have no anchor, for example the component of vertex 0"),
    ],
)
def test_given_anchors_that_do_not_fit_the_mesh_are_refused(anchors, message):
    with pytest.raises(InvalidInputError, match=message):
        check_anchors(anchors, SHEETS, 65)
