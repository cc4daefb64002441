"""Finer quantization of smooth surfaces."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding.smoothness import MIN_SHARE, sampled_frames, step_share
from samples.meshes import waving_grid
from samples.streams import recorded

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
