"""The method `reel`: modes, key blocks, and blocks that reuse their fields."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.reel.encoding import analysis
from meshreel.codec.reel.encoding.analysis import FieldChoices, analyze_fields
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.normative.blocks import write_field_block
from meshreel.codec.reel.normative.fields import decode_basis
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError, UnsupportedVersionError
from meshreel.kernel.basis import time_order
from meshreel.model.sequence import MeshSequence
from meshreel.paper.decoder import coded_blocks
from samples.coded_fields import decode_fields, decode_values
from samples.meshes import grid_faces, irregular_sequence, kg_error_percent, waving_grid
from samples.streams import Stream, layout_of, layouts, parts_of, raw_stream, recorded

STENCIL = FieldChoices(1.0).stencil_size


def field_mesh(sequence):
    return FieldMesh(sequence.faces, sequence.n_verts, STENCIL)


def matrices_of(sequence):
    return to_matrices(sequence.vertices, bounding_frame(sequence.extent))


def analyzed(step=0.002, n_frames=12, sequence=None, **choices):
    sequence = waving_grid(n_frames, 12, 13, np.float64) if sequence is None else sequence
    mesh, matrices = field_mesh(sequence), matrices_of(sequence)
    frames = BlockFrames(sequence.vertices, bounding_frame(sequence.extent))
    block = analyze_fields(frames, mesh, FieldChoices(step, **choices)).block
    return matrices, mesh, block


def noisy_grid(noise, n_frames=12):
    """A waving sheet with noise of each vertex."""
    grid = waving_grid(n_frames, 12, 13, np.float64)
    tremble = noise * np.random.default_rng(6).normal(size=grid.vertices.shape)
    return MeshSequence(grid.vertices + tremble, grid.faces)


def flat_basis(block):
    """Decoded basis of shape (3 T, K)."""
    return decode_basis(block.basis, block.layout).reshape(-1, block.n_modes)


def wanted_fields(block, matrices):
    """Least-squares fields of shape (V, K) for the decoded basis."""
    stacked = matrices.reshape(-1, matrices.shape[2])
    return np.linalg.lstsq(flat_basis(block), stacked, rcond=None)[0].T


def decoded_fields(block, mesh):
    """Decoded fields of shape (V, K), in internal order."""
    values = decode_values(mesh, block.fields, STENCIL, block.layout.n_learned)
    return float(block.layout.step) * values[mesh.number]


def test_finer_steps_reduce_the_error():
    sequence = waving_grid(12, 12, 13)
    errors = [
        kg_error_percent(sequence.vertices, decode(encode(sequence, "reel", step=step)).vertices)
        for step in (3e-3, 1e-3, 3e-4, 1e-4)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.1


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("step", "weight", "n_steps"),
    [(0.02, 0.0, 0.5), (0.002, 0.0, 0.5), (0.0001, 0.0, 0.5), (0.002, None, 1.0)],
)
def test_fields_are_within_half_a_step_or_a_step_with_rate_weight(step, weight, n_steps):
    """Closed loop: later residuals include the errors of earlier levels."""
    choices = {} if weight is None else {"rate_weight": weight}
    matrices, mesh, block = analyzed(step, 30, feedback_gain=0.0, **choices)
    error = np.abs(decoded_fields(block, mesh) - wanted_fields(block, matrices))
    assert error.max() <= n_steps * float(block.layout.step) * (1 + 1e-6)


def test_first_level_is_rounded_to_the_nearest_with_rate_weight():
    """It has few values, which predict all others."""
    matrices, mesh, block = analyzed(0.02, 30)
    first = mesh.order[: mesh.hierarchy.level_starts[1]]
    error = np.abs(decoded_fields(block, mesh) - wanted_fields(block, matrices))[first]
    assert error.max() <= 0.5 * float(block.layout.step) * (1 + 1e-6)


def test_basis_vectors_are_accurate_when_their_step_is_fine():
    matrices, _, block = analyzed(1e-5, 30, basis_step=0.1)
    vectors = flat_basis(block)
    stacked = matrices.reshape(-1, matrices.shape[2])
    left = stacked - vectors @ np.linalg.lstsq(vectors, stacked, rcond=None)[0]
    assert np.abs(left).max() < 1e-4


def test_integers_of_a_block_round_trip():
    _, mesh, block = analyzed(0.0005, sequence=irregular_sequence(20))
    sections = dict(write_field_block(block, mesh))
    assert layout_of(sections, 20) == block.layout
    order = time_order(3, 20, block.layout.coding)
    times = decode_fields(sections[Section.BASIS], block.n_modes, 60, order)
    np.testing.assert_array_equal(times.reshape(block.basis.shape), block.basis)
    coded = sections[Section.COEFFICIENTS]
    fields = decode_fields(coded, block.n_modes, mesh.n_verts, mesh.coding_order)
    np.testing.assert_array_equal(fields, block.fields)


def test_frames_are_the_product_of_fields_and_basis():
    matrices, mesh, block = analyzed(1e-5)
    basis, fields = decode_basis(block.basis, block.layout), decoded_fields(block, mesh)
    np.testing.assert_allclose(basis @ fields.T, matrices, atol=2e-4)


def test_adapted_weights_make_integers_smaller():
    """Weights that adapt to earlier modes predict better."""
    sequence = noisy_grid(0.0, 40)
    bends = sequence.vertices * (1 + 0.3 * np.sin(9 * sequence.vertices[:1, :, :1]))
    sequence = MeshSequence(bends, sequence.faces)
    _, _, learned = analyzed(3e-4, sequence=sequence)
    _, _, unlearned = analyzed(3e-4, sequence=sequence, n_learned=0)
    assert learned.n_modes == unlearned.n_modes > 4
    bits = [np.log2(1 + np.abs(block.fields[3:])).sum() for block in (learned, unlearned)]
    assert bits[0] < 0.9 * bits[1]


def test_number_of_modes_is_at_most_the_requested_one():
    assert info(encode(waving_grid(), "reel", step=1e-6, n_modes=2)).n_modes == (2,)


def test_coarser_steps_keep_fewer_modes():
    sequence = noisy_grid(0.01, 40)
    counts = [analyzed(step, sequence=sequence)[2].n_modes for step in (1e-4, 1e-2, 1e-1)]
    assert counts[0] > counts[1] > counts[2] >= 1


@pytest.mark.parametrize("number", [127, 3])
def test_layouts_of_other_builds_are_refused(number):
    first = bytes([number])
    stream = Stream(encode(waving_grid(), "reel"))
    sections = [
        (section, first + payload[1:] if section is Section.FIELDS else payload)
        for section, payload in parts_of(stream)
    ]
    with pytest.raises(UnsupportedVersionError, match="needs a newer version; update meshreel"):
        decode(raw_stream(stream.header, sections))


@pytest.mark.parametrize(("step", "is_single"), [(2.0**-15, True), (2.0**-17, False)])
def test_frames_are_summed_in_float64_for_fine_steps(step, is_single):
    sequence = waving_grid()
    data = encode(sequence, "reel", step=step)
    assert layouts(data)[0].is_single is is_single
    error = np.abs(decode(data).vertices - sequence.vertices).max()
    assert error < 6 * step * np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))


def test_reading_blocks_of_reel_as_paper_blocks_is_refused():
    with pytest.raises(InvalidInputError, match="method reel"):
        coded_blocks(encode(waving_grid(), "reel"))


def growing_grid(growth=30.0, n_frames=12, side=20):
    """A sheet whose motion grows by a factor at each resolution, so that weights are large."""
    faces = waving_grid(1, side, side).faces
    coded = encode_connectivity(faces, side**2)
    levels = field_mesh(MeshSequence(np.zeros((1, side**2, 3)), coded.internal_faces)).hierarchy
    reach = np.empty(side**2)
    reach[levels.order] = growth ** np.repeat(
        levels.level_resolutions.astype(float), np.diff(levels.level_starts)
    )
    motion = np.random.default_rng(0).normal(size=(n_frames, 1, 3)) * (reach / reach.max())[:, None]
    vertices = np.empty_like(motion)
    vertices[:, coded.internal_to_given] = motion
    return MeshSequence(vertices, faces)


@pytest.mark.parametrize("step", [1e-4, 1e-6])
def test_large_weights_do_not_amplify_errors(step):
    """Feedback without a limit would be amplified from level to level: 200 steps."""
    sequence = growing_grid()
    error = np.linalg.norm(decode(encode(sequence, step=step)).vertices - sequence.vertices, axis=2)
    diagonal = np.linalg.norm(sequence.extent.high - sequence.extent.low)
    assert error.max() <= 20 * step * diagonal


N, SIDE = 60, 17
PLACES = np.stack(np.meshgrid(*[np.linspace(0, 1, SIDE)] * 2), axis=-1).reshape(-1, 2)
X, Y = PLACES.T


def waves(times, *numbers):
    """A sheet of shape (T, V, 3) with standing waves of these wave numbers."""
    heights = sum(
        0.1 * np.sin(number * np.pi * X) * np.cos((number - 1) * Y) * np.sin(number * times / 7)
        for number in numbers
    )
    flat = np.broadcast_to(PLACES, (len(times), *PLACES.shape))
    return np.dstack([flat, heights]).astype(np.float32)


TIMES = np.arange(N, dtype=float)[:, None]
LOOPED = meshreel.MeshSequence(waves(TIMES, 1, 2, 3), grid_faces(SIDE, SIDE))
HELD_FIRST = meshreel.MeshSequence(
    np.concatenate([waves(np.ones((12, 1)), 1), waves(TIMES, *range(1, 17))]), LOOPED.faces
)
OPTIONS = {"quality": 85, "block_frames": 12}


@pytest.mark.slow
def test_reused_fields_save_bytes_for_repeated_motion(monkeypatch):
    data = meshreel.encode(LOOPED, **OPTIONS)
    first, *others = layouts(data)
    assert first.n_reused == 0
    assert all(other.n_reused > 0 for other in others)
    error = meshreel.compare(LOOPED, meshreel.decode(data)).kg_error_percent
    monkeypatch.setattr(analysis, "_analyze_reusing", lambda *_: None)
    alone = meshreel.encode(LOOPED, **OPTIONS)
    assert not any(layout.n_reused for layout in layouts(alone))
    assert len(data) < 0.85 * len(alone)
    assert error < 1.3 * meshreel.compare(LOOPED, meshreel.decode(alone)).kg_error_percent


def test_error_bound_holds_with_reused_fields():
    data = meshreel.encode(LOOPED, max_error=0.05, block_frames=12)
    assert any(layout.n_reused for layout in layouts(data))
    assert 0.01 < meshreel.compare(LOOPED, meshreel.decode(data)).max_error_percent <= 0.05


@pytest.mark.slow
def test_error_target_is_met_with_reused_fields():
    data = meshreel.encode(LOOPED, kg=1.0, block_frames=12)
    assert any(layout.n_reused for layout in layouts(data))
    assert 0.98 < meshreel.compare(LOOPED, meshreel.decode(data)).kg_error_percent <= 1.0


def test_block_with_reused_fields_decodes_alone(tmp_path):
    path = tmp_path / "looped.reel"
    path.write_bytes(meshreel.encode(LOOPED, **OPTIONS))
    together = meshreel.decode(path).vertices
    with meshreel.open(path) as reel:
        np.testing.assert_array_equal(reel[-1].vertices, together[-1])
        np.testing.assert_array_equal(reel[13].vertices, together[13])


def test_block_becomes_a_key_block_when_the_previous_one_does_not_help():
    result = layouts(meshreel.encode(HELD_FIRST, **OPTIONS))
    assert [one.reference for one in result] == [0, 0, 1, 2, 3, 4]
    assert all(one.n_reused for one in result[2:])


@pytest.mark.slow
def test_pushed_frames_reuse_fields_and_keep_tracks_across_key_blocks():
    velocity = 25 * np.gradient(HELD_FIRST.vertices, axis=0)
    tracks = {"velocity": meshreel.Track(velocity, kind="velocity")}
    sequence = HELD_FIRST.replace(fps=25.0, tracks=tracks)
    data = recorded(sequence, tracks={"velocity": "1%"}, **OPTIONS)
    assert [layout.reference for layout in layouts(data)][:3] == [0, 0, 1]
    assert meshreel.compare(HELD_FIRST, meshreel.decode(data)).kg_error_percent < 2
