"""The method `reel`."""

import numpy as np
import pytest

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import read_stream
from meshreel.bitstream.writer import write_stream
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import coded_blocks, info
from meshreel.codec.mesh_model import MeshModel
from meshreel.codec.methods import Laplacian
from meshreel.codec.reel import (
    FieldMesh,
    Layout,
    analyse_fields,
    group_ends,
    reconstruct_fields,
    synthesise_fields,
    unit_time_vectors,
)
from meshreel.errors import InvalidInputError, UnsupportedVersionError
from meshreel.sequence import MeshSequence
from meshreel.subspace.trajectories import bounding_frame, to_matrices
from sample_meshes import irregular_sequence, kg_error_percent, waving_grid


def analysed(step=0.002, n_frames=12):
    sequence = waving_grid(n_frames, 12, 13, np.float64)
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.vertices))
    none = np.zeros(0, np.int64)
    mesh = MeshModel(sequence.faces, sequence.n_verts, none, Laplacian.NORMALIZED)
    return matrices, mesh, analyse_fields(matrices, mesh, step, None)


def test_error_falls_with_the_step_when_it_is_made_finer():
    sequence = waving_grid(12, 12, 13)
    errors = [
        kg_error_percent(sequence.vertices, decode(encode(sequence, "reel", step=step)).vertices)
        for step in (3e-3, 1e-3, 3e-4, 1e-4)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.1


def test_anchors_lie_within_half_a_step_of_the_fields_when_their_stage_is_sent():
    """Closed loop: what earlier stages got wrong is in what later ones send."""
    matrices, mesh, block = analysed()
    stacked = matrices.reshape(-1, mesh.n_verts)
    fields = np.linalg.lstsq(unit_time_vectors(block.basis), stacked, rcond=None)[0].T
    fields_mesh, step = FieldMesh(mesh, block.layout), float(block.layout.step)
    largest = []

    def residuals_of(rows, stage, prediction):
        residual = block.residuals[stage][rows].T
        wanted = fields[fields_mesh.stages[stage], rows]
        largest.append(np.abs(prediction + step * residual - wanted).max())
        return residual

    reconstruct_fields(fields_mesh, lambda rows, _: block.deltas[rows].T * step, residuals_of)
    assert max(largest) <= 0.5 * step * (1 + 1e-6)


def test_frames_are_the_product_of_what_is_synthesised():
    matrices, mesh, block = analysed(step=1e-5)
    basis, fields = synthesise_fields(block, mesh)
    assert np.abs(basis @ fields - matrices).max() < 1e-3


def test_later_groups_have_smaller_deltas_when_weights_are_learned():
    """The point of the method: weights that reproduce earlier fields."""
    _, mesh, block = analysed(step=3e-4, n_frames=40)
    assert len(block.layout.group_ends) > 1
    matrices, _, _ = analysed(step=3e-4, n_frames=40)
    fields = (matrices.reshape(-1, mesh.n_verts).T @ unit_time_vectors(block.basis))[:, 3:6]
    fields_mesh = FieldMesh(mesh, block.layout)
    known = (matrices.reshape(-1, mesh.n_verts).T @ unit_time_vectors(block.basis))[:, :3]
    learned = np.abs(fields_mesh.laplacian(known) @ fields).mean()
    uniform = np.abs(fields_mesh.laplacian(np.zeros((mesh.n_verts, 0))) @ fields).mean()
    assert learned < 0.7 * uniform


@pytest.mark.parametrize(
    ("n_modes", "expected"),
    [(1, (1,)), (2, (2,)), (3, (2, 3)), (8, (2, 4, 8)), (50, (2, 4, 8, 50))],
)
def test_groups_end_with_the_last_mode_whatever_their_number(n_modes, expected):
    assert group_ends(n_modes, (2, 4, 8)) == expected


def test_modes_are_no_more_than_asked_for():
    assert info(encode(waving_grid(), "reel", step=1e-6, n_modes=2)).n_modes == (2,)


@pytest.mark.parametrize("n_frames", [1, 2, 300])
def test_sequence_comes_back_whatever_its_length(n_frames):
    sequence = waving_grid(n_frames)
    decoded = decode(encode(sequence, "reel", step=1e-5))
    assert kg_error_percent(sequence.vertices, decoded.vertices) < 0.1


def test_still_sequence_takes_few_modes_when_nothing_moves():
    still = np.repeat(waving_grid(1).vertices, 60, axis=0)
    data = encode(MeshSequence(still, waving_grid(1).faces), "reel", step=1e-4)
    assert info(data).n_modes == (3,)
    assert kg_error_percent(still, decode(data).vertices) < 0.5


def test_isolated_vertices_come_back_exactly_when_the_step_is_coarse():
    sequence = irregular_sequence()
    decoded = decode(encode(sequence, "reel", step=0.05))
    np.testing.assert_array_equal(decoded.vertices[:, 0], sequence.vertices[:, 0])


def test_other_layouts_are_refused_when_the_method_is_in_the_making():
    stream = read_stream(encode(waving_grid(), "reel"))
    sections = [
        (stored.id, b"\x7f" + stored.payload[1:] if stored.id is Section.FIELDS else stored.payload)
        for stored in stream.sections[:-1]
    ]
    with pytest.raises(UnsupportedVersionError, match="in the making"):
        decode(write_stream(stream.header, sections))


def test_blocks_of_the_papers_kind_are_refused_when_there_are_none():
    with pytest.raises(InvalidInputError, match="method reel"):
        coded_blocks(encode(waving_grid(), "reel"))


def test_layout_is_what_the_block_was_made_with():
    _, _, block = analysed()
    assert isinstance(block.layout, Layout)
    assert block.layout.group_ends[-1] == block.n_modes == len(block.deltas)
