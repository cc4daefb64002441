"""The deformation graph moves a mesh by its nodes."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from meshreel.registration.graph import (
    N_NEAREST,
    DeformationGraph,
    Pose,
    edge_lengths,
    rotations_of,
)
from samples.captures import capsule


@pytest.fixture(scope="module")
def key():
    return capsule(30, 26)


@pytest.fixture(scope="module")
def graph(key):
    vertices, faces = key
    return DeformationGraph.of_mesh(vertices, faces, 0.3)


def no_details(key):
    return np.zeros_like(key[0])


def test_the_key_is_its_pose_at_rest(key, graph):
    posed = graph.posed(Pose.at_rest(len(graph.nodes)), no_details(key))
    np.testing.assert_allclose(posed.positions, key[0], atol=1e-12)


def test_equal_motions_of_all_nodes_move_the_mesh_rigidly(key, graph):
    turn, center = rotations_of(np.array([[0.0, 0.0, np.pi / 2]]))[0], np.array([1.0, 2.0, 3.0])
    moved = graph.nodes @ turn.T + center
    pose = Pose(np.tile(turn, (len(moved), 1, 1)), moved - graph.nodes)
    posed = graph.posed(pose, no_details(key))
    np.testing.assert_allclose(posed.positions, key[0] @ turn.T + center, atol=1e-12)


def test_details_turn_with_the_nodes(key, graph):
    turn = rotations_of(np.array([[0.0, 0.0, np.pi / 2]]))[0]
    n_nodes = len(graph.nodes)
    pose = Pose(np.tile(turn, (n_nodes, 1, 1)), graph.nodes @ turn.T - graph.nodes)
    details = np.tile([0.1, 0.0, 0.0], (len(key[0]), 1))
    change = graph.posed(pose, details).positions - graph.posed(pose, no_details(key)).positions
    np.testing.assert_allclose(change, np.tile([0.0, 0.1, 0.0], (len(key[0]), 1)), atol=1e-12)


def test_nodes_keep_their_distance(graph):
    gaps = np.linalg.norm(graph.nodes[:, None] - graph.nodes, axis=2)
    assert len(graph.nodes) > 10
    assert gaps[~np.eye(len(gaps), dtype=bool)].min() > 0.2  # 0.3 along edges


def test_weights_fall_to_zero_at_the_nearest_node_that_does_not_move_the_vertex(key, graph):
    is_node = (key[0] == graph.nodes[:, None]).all(axis=2)
    distances = dijkstra(edge_lengths(*key), indices=np.argmax(is_node, axis=1)).T
    nearest = np.sort(distances, axis=1)[:, : N_NEAREST + 1]
    weights = np.square(1 - nearest[:, :-1] / nearest[:, -1:])
    expected = weights / weights.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(graph.weights, expected, atol=1e-3)


def test_components_do_not_share_nodes(key):
    vertices, faces = key
    both = (
        np.vstack([vertices, vertices + np.array([0.61, 0, 0])]),
        np.vstack([faces, faces + len(vertices)]),
    )
    graph = DeformationGraph.of_mesh(*both, 0.3)
    is_second = graph.nodes[:, 0] > 0.305
    nearest = np.where(graph.weights > 0, is_second[graph.nearest], is_second[graph.nearest[:, :1]])
    assert np.array_equal(nearest.all(axis=1), np.arange(len(both[0])) >= len(vertices))
    assert np.array_equal(nearest.any(axis=1), nearest.all(axis=1))


def test_constant_velocity_repeats_the_last_motion():
    turn = rotations_of(np.array([[0.3, 0.0, 0.0]]))
    before, now = Pose.at_rest(1), Pose(turn, np.array([[1.0, 0.0, 0.0]]))
    following = now.extrapolated(before)
    np.testing.assert_allclose(following.rotations, turn @ turn)
    np.testing.assert_allclose(following.translations, [[2.0, 0.0, 0.0]])
