"""Static cameras, and cameras that follow a mesh."""

import numpy as np
import pytest

from meshreel.model.sequence import MeshSequence
from meshreel.rendering.scenes import ChosenFrames
from meshreel.rendering.shots import MIN_DISTANCE_RATIO, Framing, framing_of
from meshreel.rendering.views import View

FRONT = View("y", 0.0, 0.0)


def travelling(sequence, step):
    """The sequence, moving to the right by `step` per frame."""
    steps = np.arange(sequence.n_frames)[:, None] * np.array([step, 0, 0])
    vertices = sequence.vertices + steps[:, None]
    return ChosenFrames(sequence.replace(vertices=vertices), range(0, sequence.n_frames, 3))


def test_static_camera_sees_all_frames(grid):
    frames = travelling(grid, 0.5)
    cameras = Framing(FRONT).cameras(frames, 300, 200)
    assert len(cameras) == len(frames.numbers)
    assert all(camera is cameras[0] for camera in cameras)
    points = np.array([cameras[0].project(frame)[0] for frame in frames])
    assert points.min() >= 0
    assert points[..., 0].max() <= 300
    assert np.ptp(points[..., 0]) > 240


def test_following_camera_keeps_the_mean_vertex_in_place(grid):
    frames = travelling(grid, 0.5)
    cameras = Framing(FRONT, is_followed=True).cameras(frames, 300, 200)
    middles = [
        camera.project(frame.mean(axis=0, dtype=np.float64)[None])[0][0]
        for camera, frame in zip(cameras, frames, strict=True)
    ]
    assert np.ptp(middles, axis=0) == pytest.approx([0, 0], abs=1e-6)
    steps = np.diff([camera.eye for camera in cameras], axis=0)
    motion = np.diff([frame.mean(axis=0, dtype=np.float64) for frame in frames], axis=0)
    assert steps == pytest.approx(motion)


def test_aspect_of_a_following_camera_is_that_of_one_frame(grid):
    frames = travelling(grid, 0.5)
    assert Framing(FRONT).aspect(frames) > 3 * Framing(FRONT, is_followed=True).aspect(frames)


def distance_ratio(frames):
    """Ratio of the distance of a static camera to that of one that follows."""
    static = Framing(FRONT).cameras(frames, 512, 512)
    following = Framing(FRONT, is_followed=True).cameras(frames, 512, 512)
    far, near = (
        np.mean([(frame.mean(axis=0, dtype=np.float64) - camera.eye) @ camera.axes[2]
                 for camera, frame in zip(cameras, frames, strict=True)])
        for cameras in (static, following)
    )  # fmt: skip
    return far / near


def test_camera_follows_if_that_brings_it_much_nearer(grid):
    steps = np.linspace(0, 0.05, 26)
    ratios = [distance_ratio(travelling(grid, step)) for step in steps]
    followed = [framing_of(FRONT, travelling(grid, step)).is_followed for step in steps]
    assert min(ratios) < 1.1 < MIN_DISTANCE_RATIO == 1.15 < 1.2 < max(ratios)
    assert followed == [ratio > MIN_DISTANCE_RATIO for ratio in ratios]


@pytest.mark.parametrize("is_followed", [True, False])
def test_explicit_choice_overrides_the_default(grid, is_followed):
    for step in (0.0, 0.5):
        frames = travelling(grid, step)
        assert framing_of(FRONT, frames, is_followed=is_followed).is_followed == is_followed


def test_a_following_camera_does_not_jump_where_the_faces_change(grid):
    """Vertices that are added in a corner move their mean, but not the surface."""
    still = grid.replace(vertices=np.repeat(grid.vertices[:1], 4, axis=0))
    corner = np.repeat(still.vertices[:, :1], 200, axis=1)
    dense = still.replace(vertices=np.concatenate([still.vertices, corner], axis=1))
    frames = ChosenFrames(MeshSequence.of_segments([still, dense]), range(8))
    eyes = np.array(
        [camera.eye for camera in Framing(FRONT, is_followed=True).cameras(frames, 300, 200)]
    )
    means = np.array([frame.mean(axis=0) for frame in frames])
    assert np.ptp(means, axis=0).max() > 0.2
    assert np.ptp(eyes, axis=0).max() < 1e-6
