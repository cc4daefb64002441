import numpy as np
import pytest

from meshreel.codec.options import config_of
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.paper.anchors import choose_anchors
from meshreel.paper.laplacian import component_labels
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.pipeline import analyse, synthesise
from meshreel.paper.settings import anchors_of
from meshreel.paper.variants import variant_named
from samples.meshes import irregular_sequence, waving_grid


def round_trip(sequence, config):
    faces = sequence.faces
    anchors = choose_anchors(faces, sequence.n_verts, anchors_of(config))
    mesh = MeshModel(faces, sequence.n_verts, anchors, config.laplacian_choice)
    frame = bounding_frame(sequence.extent)
    matrices = to_matrices(sequence.vertices, frame)
    frames_of = synthesise(
        analyse(sequence.vertices, frame, mesh, config).values,
        mesh,
        variant_named(config.method),
        np.arange(sequence.n_verts),
    )
    return matrices, frames_of(slice(None)), mesh


@pytest.mark.parametrize("laplacian", ["normalized", "combinatorial"])
@pytest.mark.parametrize("anchors", [0.0, 0.01, 1.0])
def test_frames_with_all_modes_and_fine_steps_round_trip(laplacian, anchors):
    config = config_of("pca-qp", n_modes=12, bits=24, anchors=anchors, laplacian=laplacian)
    matrices, matrices_hat, _ = round_trip(waving_grid(12), config)
    # Only the dictionary and the anchors are rounded, to 16 bits.
    assert np.abs(matrices_hat - matrices).max() < 2e-4


def test_error_falls_with_more_bits():
    errors = []
    for bits in (5, 7, 9, 11):
        matrices, matrices_hat, _ = round_trip(
            waving_grid(12), config_of("pca-qp", n_modes=12, bits=bits)
        )
        errors.append(np.linalg.norm(matrices_hat - matrices))
    assert errors == sorted(errors, reverse=True)


def test_solving_for_modes_equals_solving_for_frames():
    """PCA+qp and PCA+qs: the Laplacian and the projection commute (Eq. 12)."""
    _, parallel, _ = round_trip(waving_grid(12), config_of("pca-qp", n_modes=5))
    _, serial, _ = round_trip(waving_grid(12), config_of("pca-qs", n_modes=5))
    np.testing.assert_allclose(serial, parallel, atol=1e-9)


def test_connected_vertices_round_trip_next_to_isolated_ones():
    sequence = irregular_sequence()
    config = config_of("pca-qp", n_modes=8, bits=24)
    matrices, matrices_hat, mesh = round_trip(sequence, config)
    connected = np.setdiff1d(np.arange(sequence.n_verts), mesh.isolated)
    assert np.abs(matrices_hat - matrices)[:, :, connected].max() < 5e-4


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_every_component_with_edges_has_an_anchor(share):
    sequence = irregular_sequence()
    anchors = choose_anchors(sequence.faces, sequence.n_verts, share)
    _, labels = component_labels(sequence.faces, sequence.n_verts)
    assert set(labels[anchors]) == {1, 2}


def test_number_of_anchors_is_the_given_share():
    sequence = waving_grid(2, 20, 20)
    assert len(choose_anchors(sequence.faces, 400, 0.01)) == 4
