"""Resting vertices stay at rest, and smooth surfaces are quantized finer."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import analysis, basis_coding
from meshreel.codec.reel.encoding.smoothness import MIN_SHARE, sampled_frames, step_share
from meshreel.kernel.basis import NO_REST
from samples.meshes import waving_grid
from samples.streams import layouts, recorded

SIDE = 15


def waving(n_frames=40):
    """A waving sheet, of shape (T, V, 3), and its faces."""
    sheet = waving_grid(n_frames, SIDE, SIDE, np.float64)
    tremble = 0.02 * np.random.default_rng(2).normal(size=(8, SIDE * SIDE, 3))
    curves = np.sin(np.arange(n_frames)[:, None] * np.linspace(0.1, 0.9, 8))
    return sheet.vertices + np.tensordot(curves, tremble, 1), sheet.faces


def held(start=20, end=30, moving=0.0):
    """A sheet at rest in some frames, where optionally a tenth of its vertices move."""
    vertices, faces = waving()
    before = vertices[start - 1]
    rest = np.repeat(before[None], end - start, axis=0)
    few = slice(0, SIDE * SIDE // 10)
    rest[:, few, 2] += moving * np.arange(1, end - start + 1)[:, None]
    vertices = np.concatenate([vertices[:start], rest, vertices[start:]])
    return meshreel.MeshSequence(vertices.astype(np.float32), faces)


def half_still():
    """A sheet with one half at rest."""
    vertices, faces = waving()
    share = np.clip(vertices[0, :, 0] / np.ptp(vertices[0, :, 0]) - 0.5, 0.0, 0.3)[:, None]
    return meshreel.MeshSequence((vertices[0] + share * (vertices - vertices[0])), faces)


def rests_of(data):
    return [layout.coding.rests for layout in layouts(data)]


def steps_percent(vertices):
    """Displacements of vertices between frames, in percent of the diagonal of the first."""
    result = np.asarray(vertices, np.float64)
    diagonal = np.linalg.norm(np.ptp(result[0], axis=0))
    return 100.0 * np.linalg.norm(np.diff(result, axis=0), axis=2) / diagonal


def test_equal_frames_are_decoded_equal():
    data = meshreel.encode(held())
    assert [rests.runs for rests in rests_of(data)] == [((20, 30),)]
    decoded = meshreel.decode(data).vertices
    np.testing.assert_array_equal(decoded[20:30], np.repeat(decoded[19:20], 10, axis=0))


def test_most_vertices_rest_when_few_move():
    sequence = held(moving=0.002)
    still = np.ones(sequence.n_verts, np.bool_)
    still[: SIDE * SIDE // 10] = False
    data = meshreel.encode(sequence)
    steps = steps_percent(meshreel.decode(data).vertices)[19:29]
    assert [rests.runs for rests in rests_of(data)] == [((20, 30),)]
    assert np.median(steps[:, still]) < 0.01
    wanted = steps_percent(sequence.vertices)[19:29]
    np.testing.assert_allclose(
        steps[:, ~still].sum(axis=0), wanted[:, ~still].sum(axis=0), rtol=0.2
    )


def test_resting_sheet_does_not_enlarge_the_stream(monkeypatch):
    resting = len(meshreel.encode(held()))
    monkeypatch.setattr(basis_coding, "find_rests", lambda *_: NO_REST)
    monkeypatch.setattr(basis_coding, "MIN_COSINE_GAIN", 1.0)
    assert resting < 1.01 * len(meshreel.encode(held()))


def test_part_that_never_moves_rests(monkeypatch):
    sequence = half_still()
    still = steps_percent(sequence.vertices).max(axis=0) == 0.0
    assert 0.3 < still.mean() < 0.7
    with_means = meshreel.encode(sequence)
    monkeypatch.setattr(analysis, "has_resting_vertices", lambda *_: False)
    without = meshreel.encode(sequence)
    result, crawling = (
        np.median(steps_percent(meshreel.decode(data).vertices)[:, still])
        for data in (with_means, without)
    )
    assert result < 0.01
    assert result < 0.5 * crawling
    assert len(with_means) < 1.02 * len(without)


def test_no_time_rests_when_most_of_the_model_moves():
    vertices, faces = waving()
    most = slice(0, SIDE * SIDE * 6 // 10)
    vertices[5:35, most] = vertices[5, most]
    sequence = meshreel.MeshSequence(vertices, faces)
    assert rests_of(meshreel.encode(sequence, quality=95)) == [NO_REST]


def test_rests_are_found_with_reused_fields():
    vertices, faces = waving(60)
    vertices[40:50] = vertices[40]
    sequence = meshreel.MeshSequence(vertices, faces)
    data = meshreel.encode(sequence, block_frames=30)
    layout = layouts(data)[1]
    assert layout.n_reused > 0
    assert layout.coding.rests.runs == ((11, 20),)
    decoded = meshreel.decode(data).vertices
    np.testing.assert_array_equal(decoded[41:50], np.repeat(decoded[40:41], 9, axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("bound", [0.02, 0.2])
def test_error_bound_holds_for_resting_frames(bound):
    sequence = held(moving=0.002)
    decoded = meshreel.decode(meshreel.encode(sequence, max_error=bound))
    assert meshreel.compare(sequence, decoded).max_error_percent <= bound


FACES = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def hinge(angle_deg):
    """Two triangles whose normals have this angle."""
    turn = np.radians(angle_deg)
    return np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [np.cos(turn), 0.5, np.sin(turn)]], float)


WITHOUT_AREA = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]], np.int32)
SHARES = {
    "flat": (FACES, [hinge(0.0)], 0.2),
    "4 degrees": (FACES, [hinge(4.0)], 0.5**1.5),
    "8 degrees": (FACES, [hinge(8.0)], 1.0),
    "a right angle": (FACES, [hinge(90.0)], 1.0),
    "mean over frames": (FACES, [hinge(1.0), hinge(1.0), hinge(7.0)], (3 / 8) ** 1.5),
    "a face without area": (WITHOUT_AREA, [[*hinge(4.0), hinge(4.0)[3]]], 0.5**1.5),
    "a flipped face": (np.array([[0, 1, 2], [1, 2, 3]], np.int32), [hinge(4.0)], 0.5**1.5),
    "no area": (FACES, [np.zeros((4, 3))], 1.0),
    "one face": (FACES[:1], [hinge(4.0)], 1.0),
    "one point far away": (FACES, [np.full((4, 3), 1e200)], 1.0),
    "huge": (FACES, [1e200 * hinge(4.0)], 1.0),
}


@pytest.mark.every_case
@pytest.mark.parametrize("name", SHARES)
def test_step_depends_on_the_mean_angle_between_normals(name):
    faces, frames, share = SHARES[name]
    vertices = np.array(frames, float)
    assert step_share(faces, vertices.shape[1], vertices) == pytest.approx(share)


def test_sampled_edges_cover_the_whole_surface():
    """A ribbon with folds of 1 degree in its first half and 7 degrees in the other."""
    n_quads = 12_000
    ribbon = np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 0.5, 0]])
    turn = np.radians(np.where(np.arange(n_quads) < n_quads // 2, 1.0, 7.0))
    vertices = np.tile(ribbon, (n_quads, 1, 1))
    vertices[:, 3, 0], vertices[:, 3, 2] = np.cos(turn), np.sin(turn)
    faces = (FACES + 4 * np.arange(n_quads, dtype=np.int32)[:, None, None]).reshape(-1, 3)
    share = step_share(faces, 4 * n_quads, vertices.reshape(1, -1, 3))
    assert share == pytest.approx(0.5**1.5, rel=0.01)


@pytest.mark.parametrize("n_frames", [1, 2, 3, 4, 5, 300])
def test_sampled_frames_are_within_the_sequence(n_frames):
    numbers = sampled_frames(n_frames)
    assert set(numbers) <= set(range(n_frames))
    assert len(numbers) == min(n_frames, 4)


def test_sampled_frames_are_the_middles_of_quarters():
    assert sampled_frames(80) == [10, 30, 50, 70]


def test_smooth_sheet_is_coded_more_finely_than_a_rough_one():
    smooth = waving_grid(8, 30, 30)
    flatter = smooth.vertices * np.array([1, 1, 0.05], np.float32)
    rough = flatter.copy()
    rough[:, :, 2] += 0.02 * np.random.default_rng(1).normal(size=smooth.n_verts)
    errors = []
    for vertices in (flatter, rough):
        sequence = meshreel.MeshSequence(vertices.astype(np.float32), smooth.faces)
        decoded = meshreel.decode(meshreel.encode(sequence, order="vertices", quality=60))
        errors.append(meshreel.compare(sequence, decoded).rms_error_percent)
    assert errors[0] < 0.6 * errors[1]


def test_smooth_live_recording_is_coded_as_finely_as_a_file():
    sequence = waving_grid(6, 20, 20)
    streams = recorded(sequence, block_frames=6), meshreel.encode(sequence)
    errors = [meshreel.compare(sequence, data).rms_error_percent for data in streams]
    assert errors[0] == pytest.approx(errors[1], rel=0.02)
    assert MIN_SHARE <= step_share(sequence.faces, sequence.n_verts, sequence.vertices) < 1
