"""Resting vertices stay at rest."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import analysis, basis_coding
from meshreel.kernel.basis import NO_REST
from samples.meshes import waving_grid
from samples.streams import layouts

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
    with_means = meshreel.encode(sequence, step=2e-5)
    monkeypatch.setattr(analysis, "has_resting_vertices", lambda *_: False)
    without = meshreel.encode(sequence, step=2e-5)
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
