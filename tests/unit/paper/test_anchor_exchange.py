"""Anchors, and exchanged anchors against errors that are computed with dense matrices."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from meshreel.codec.bitstream.layout import Laplacian
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import component_labels
from meshreel.paper import anchor_exchange
from meshreel.paper.anchor_exchange import MIN_REDUCTION, exchange_anchors
from meshreel.paper.anchors import check_anchors, choose_anchors, farthest_points
from meshreel.paper.laplacian import adjacency_matrix
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.stream import read
from samples.meshes import (
    grid_faces,
    irregular_sequence,
    kg_error_percent,
    octahedron_faces,
    waving_grid,
)

TWO_SHEETS = np.concatenate([grid_faces(4, 5), octahedron_faces() + 20])


def mesh_of(faces, n_verts, anchors):
    return MeshModel(faces, n_verts, np.array(anchors), Laplacian.NORMALIZED)


def noise(n_verts, n_columns=7):
    return np.random.default_rng(5).normal(size=(n_verts, n_columns))


def squared_error(mesh, anchors, delta_errors):
    laplacian = mesh.laplacian.toarray()
    matrix = laplacian.T @ laplacian
    matrix[anchors, anchors] += 1
    return float((np.linalg.solve(matrix, laplacian.T @ delta_errors) ** 2).sum())


def test_no_single_exchange_is_better_by_dense_matrices():
    mesh, errors = mesh_of(grid_faces(4, 5), 20, [0, 1, 2]), noise(20)
    result = exchange_anchors(mesh, [errors[:, :3], errors[:, 3:]])
    best = squared_error(mesh, result, errors)
    assert best < squared_error(mesh, mesh.anchors, errors)
    for anchor in result:
        for vertex in set(range(20)) - set(result):
            others = [*(set(result) - {anchor}), vertex]
            assert squared_error(mesh, others, errors) >= best * (1 - MIN_REDUCTION / 3)


def test_squared_error_after_changes_is_that_of_dense_matrices():
    mesh, errors = mesh_of(grid_faces(4, 5), 20, [0, 7]), noise(20)
    candidates = np.array([0, 3, 7, 11])
    state = anchor_exchange._initial_state(mesh, candidates, [errors])
    for position, sign, anchors in ((1, 1, [0, 3, 7]), (2, -1, [0, 3]), (3, 1, [0, 3, 11])):
        state = state.changed(position, sign)
        assert state.squared_error == pytest.approx(squared_error(mesh, anchors, errors))


def test_only_anchor_of_a_component_is_exchanged_within_it():
    mesh, errors = mesh_of(TWO_SHEETS, 26, [0, 20]), noise(26)
    result = exchange_anchors(mesh, [errors])
    assert result.tolist() != [0, 20]
    assert result[0] < 20 <= result[1]
    assert squared_error(mesh, result, errors) < squared_error(mesh, [0, 20], errors)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "block_frames"), [("pca-qp", None), ("blocks", 10)])
def test_optimized_anchors_reduce_the_error_at_equal_rate(method, block_frames):
    sequence = waving_grid(20, 30, 30)
    options = {"n_modes": 2, "bits": 8, "anchors": 0.02, "block_frames": block_frames}
    streams = [
        encode(sequence, method, choices={"anchor_set": name}, **options)
        for name in ("farthest", "optimized")
    ]
    farthest, optimized = (
        kg_error_percent(sequence.vertices, decode(data).vertices) for data in streams
    )
    assert optimized < 0.95 * farthest
    assert len(streams[1]) < 1.02 * len(streams[0])


@pytest.mark.parametrize(
    ("method", "values"),
    [
        ("pca-qp", "positions"),
        ("pca-qp", "coefficients"),
        ("pca-qs", "positions"),
        ("blocks", "positions"),
        ("blocks", "coefficients"),
        ("gft", "positions"),
    ],
)
def test_optimized_anchors_give_the_stream_of_the_same_listed_anchors(method, values):
    sequence, options = irregular_sequence(), {"n_modes": 2, "bits": 6}
    if method == "blocks":
        options["block_frames"] = 3
    choices = {"anchor_values": values}
    data = encode(
        sequence, method, anchors=0.2, choices={**choices, "anchor_set": "optimized"}, **options
    )
    anchors = read(data).anchors.tolist()
    assert len(anchors) == 8
    labels = component_labels(sequence.faces, sequence.n_verts)
    assert len(set(labels[anchors])) == 2
    assert encode(sequence, method, anchors=anchors, choices=choices, **options) == data


def test_more_anchors_than_fit_in_memory_are_refused(monkeypatch):
    monkeypatch.setattr(anchor_exchange, "MAX_RESPONSES", 20 * 2)
    mesh = mesh_of(grid_faces(4, 5), 20, [0, 5, 9])
    with pytest.raises(InvalidInputError, match=r"at most 2 anchors of 20 vertices; got 3\. Use"):
        exchange_anchors(mesh, [noise(20)])


def test_candidates_are_limited_by_memory_and_contain_the_anchors(monkeypatch):
    monkeypatch.setattr(anchor_exchange, "MAX_RESPONSES", 20 * 5)
    mesh = mesh_of(grid_faces(4, 5), 20, [6, 7, 8])
    candidates = anchor_exchange._candidates(mesh)
    assert len(candidates) == 5
    assert {6, 7, 8} <= set(candidates.tolist())


def test_exchange_without_errors_keeps_the_anchors():
    mesh = mesh_of(grid_faces(4, 5), 20, [1, 2])
    assert exchange_anchors(mesh, [np.zeros((20, 3))]).tolist() == [1, 2]


def test_mesh_with_other_anchors_keeps_the_graph_fourier_basis():
    mesh = mesh_of(grid_faces(4, 5), 20, [1, 2])
    basis = mesh.graph_fourier_basis(3)
    other = mesh.with_anchors(np.array([4]))
    assert other.graph_fourier_basis(3) is basis
    assert other.anchors.tolist() == [4]
    assert not np.allclose(other.responses(np.array([4])), mesh.responses(np.array([4])))


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
