"""Exchanged anchors against errors that are computed with dense matrices."""

import numpy as np
import pytest

import meshreel
from anchor_exchange import MIN_REDUCTION, better_anchors, exchanged
from meshreel import paper
from samples.meshes import grid_faces, irregular_sequence, octahedron_faces, waving_grid

TWO_COMPONENTS = np.concatenate([grid_faces(4, 5), octahedron_faces() + 20])


class Dense:
    """Eq. 12 of a mesh with noise in the deltas."""

    def __init__(self, faces, n_verts):
        self.laplacian = paper.uniform_laplacian(faces, n_verts, normalized=True).toarray()
        self.noise = np.random.default_rng(5).normal(size=(n_verts, 7))

    def inverse(self, anchors):
        matrix = self.laplacian.T @ self.laplacian
        matrix[anchors, anchors] += 1
        return np.linalg.inv(matrix)

    def errors(self, anchors):
        return self.inverse(anchors) @ self.laplacian.T @ self.noise

    def squared_error(self, anchors):
        return np.vdot(self.errors(anchors), self.errors(anchors))

    def exchanged(self, anchors):
        candidates = np.arange(len(self.noise))
        return exchanged(anchors, candidates, self.inverse(anchors), self.errors(anchors))


def test_no_other_exchange_is_better_by_dense_matrices():
    mesh, first = Dense(grid_faces(4, 5), 20), np.array([0, 1, 2])
    result = mesh.exchanged(first)
    best = mesh.squared_error(result)
    assert best < mesh.squared_error(first)
    for anchor in result:
        for vertex in set(range(20)) - set(result):
            others = [*(set(result) - {anchor}), vertex]
            assert mesh.squared_error(others) >= best * (1 - MIN_REDUCTION / 3)


def test_only_anchor_of_a_component_is_exchanged_within_it():
    mesh, first = Dense(TWO_COMPONENTS, 26), np.array([0, 20])
    result = mesh.exchanged(first)
    assert result[0] < 20 <= result[1]
    assert mesh.squared_error(result) < mesh.squared_error(first)


def test_anchors_without_other_candidates_stay():
    errors = np.random.default_rng(5).normal(size=(3, 2))
    anchors = np.arange(3)
    assert exchanged(anchors, anchors, np.eye(3), errors).tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("sequence", "share", "most"),
    [(waving_grid(20, 30, 30), 0.02, 0.95), (irregular_sequence(), 0.2, 1)],
)
def test_exchanged_anchors_decode_with_a_smaller_error(sequence, share, most):
    def error(anchors):
        data = meshreel.encode(sequence, "pca-qp", n_modes=2, anchors=anchors)
        return data, meshreel.compare(sequence, meshreel.decode(data)).kg_error_percent

    data, farthest = error(share)
    anchors = better_anchors(sequence, paper.read(data)).tolist()
    assert len(anchors) == paper.read(data).anchors.size
    assert error(anchors)[1] < most * farthest
