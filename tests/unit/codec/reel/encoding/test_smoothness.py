"""Finer quantization of smooth surfaces."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding.smoothness import MIN_SHARE, sampled_frames, step_share
from samples.meshes import waving_grid

FACES = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


def hinge(angle_deg):
    """Two triangles whose normals have this angle."""
    turn = np.radians(angle_deg)
    return np.array([[-1, 0, 0], [0, 0, 0], [0, 1, 0], [np.cos(turn), 0.5, np.sin(turn)]], float)


@pytest.mark.parametrize(("angle", "share"), [(0.0, 0.2), (4.0, 0.5**1.5), (8.0, 1.0), (90.0, 1.0)])
def test_step_depends_on_the_angle_between_normals(angle, share):
    assert step_share(FACES, 4, hinge(angle)[None]) == pytest.approx(share)


def test_step_depends_on_the_mean_angle_over_frames():
    share = step_share(FACES, 4, np.stack([hinge(1.0), hinge(1.0), hinge(7.0)]))
    assert share == pytest.approx((3 / 8) ** 1.5)


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


def test_face_without_area_is_ignored():
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]], np.int32)
    vertices = np.concatenate([hinge(4.0), hinge(4.0)[3:]])
    assert step_share(faces, 5, vertices[None]) == pytest.approx(0.5**1.5)


def test_flipped_face_is_not_a_crease():
    turned = np.array([[0, 1, 2], [1, 2, 3]], np.int32)
    assert step_share(turned, 4, hinge(4.0)[None]) == step_share(FACES, 4, hinge(4.0)[None])


def test_step_is_unchanged_without_angles():
    flat = np.zeros((4, 3))
    assert step_share(FACES, 4, flat[None]) == 1.0
    assert step_share(FACES[:1], 4, hinge(4.0)[None]) == 1.0
    assert step_share(FACES, 4, np.full((1, 4, 3), 1e200)) == 1.0
    assert step_share(FACES, 4, 1e200 * hinge(4.0)[None]) == 1.0


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


def test_smooth_live_recording_is_coded_as_finely_as_a_file(tmp_path):
    sequence = waving_grid(6, 20, 20)
    with meshreel.Encoder(sequence.faces, tmp_path / "live.reel", block_frames=6) as encoder:
        for frame in sequence.vertices:
            encoder.push(frame)
    live = meshreel.load(tmp_path / "live.reel")
    whole = meshreel.decode(meshreel.encode(sequence))
    errors = [meshreel.compare(sequence, one).rms_error_percent for one in (live, whole)]
    assert errors[0] == pytest.approx(errors[1], rel=0.02)
    assert MIN_SHARE <= step_share(sequence.faces, sequence.n_verts, sequence.vertices) < 1
