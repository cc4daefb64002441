"""Surface that frames lack moves as in the frames near in time that show it."""

import numpy as np

from meshreel.kernel.closest import TriangleTree
from meshreel.registration.filling import N_NEAR, filled_frames, interpolated
from meshreel.registration.register import register
from samples.captures import as_frames, bent, capsule


def without_end(vertices, faces, height):
    """The mesh below a height of the unbent capsule; `vertices` are a function of it."""
    rest, posed = vertices
    faces = faces[rest[faces][:, :, 2].mean(axis=1) < height]
    used, corners = np.unique(faces, return_inverse=True)
    return posed[used], corners.reshape(-1, 3).astype(np.int32)


def swinging(lacking, n_frames=5):
    """A capsule whose end swings, and is cut off in some frames; and the whole surfaces."""
    frames, truth = [], []
    for number in range(n_frames):
        rest, faces = capsule(34, 28, 0.3 * number)
        posed = bent(rest, 0.15 * number)
        truth.append((posed, faces))
        frame = without_end((rest, posed), faces, 0.65) if number in lacking else (posed, faces)
        frames.append(frame)
    return as_frames(frames), truth


def largest_distance(registration, truth, number):
    """Largest distance of a registered frame from the whole surface, in tolerances."""
    positions = registration.sequence[number].vertices.astype(np.float64)
    distances = TriangleTree(*truth[number]).closest(positions).distances
    return distances.max() / (registration.tolerance.length * registration.frames.capture.scale)


def test_an_end_that_one_frame_lacks_is_filled():
    raw, truth = swinging({2})
    registration = register(raw, tolerance="0.2%")
    assert registration.sequence.n_segments == 1
    assert largest_distance(registration, truth, 2) < 2.0
    notes = "\n".join(str(note) for note in registration.changes)
    assert "missing surface of frame 2 (up to" in notes
    assert "filled as frames near in time show it" in notes


def test_an_end_that_no_near_frame_shows_is_named():
    faces = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    positions = np.random.default_rng(0).random((2 * N_NEAR + 3, 4, 3))
    hidden = np.array([True, True, True, False])
    is_shown = dict.fromkeys(range(1, len(positions)), hidden)
    frames = {
        number: (filled, unknown)
        for number, filled, unknown in filled_frames(
            positions.__getitem__, len(positions), faces, is_shown
        )
    }
    assert not frames[N_NEAR][1].any()
    filled, unknown = frames[N_NEAR + 1]
    assert unknown.tolist() == [False, False, False, True]
    np.testing.assert_array_equal(filled[:3], positions[N_NEAR + 1, :3])


def test_a_region_follows_the_rigid_motion_of_its_surroundings():
    vertices, faces = capsule(20, 16)
    hidden = np.ones(len(vertices), bool)
    hidden[np.linalg.norm(vertices - vertices[150], axis=1) < 0.15] = False
    angle = 0.6
    bump = np.isin(np.arange(len(vertices)), np.flatnonzero(hidden)[::7])
    vertices[bump] *= 1.05  # or the surface around it could turn around its axis
    turn = [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    moved = vertices @ np.array(turn) + [1, 2, 3]
    damaged = np.where(hidden[:, None], moved, 0.0)
    ((_, filled, _),) = filled_frames([vertices, damaged].__getitem__, 2, faces, {1: hidden})
    np.testing.assert_allclose(filled, moved, atol=0.01)


def test_positions_between_known_frames_are_those_of_a_spline():
    times = np.array([-3, -2, -1, 1, 2, 3])
    positions = np.stack([0.1 * times**3, 1.0 * times, times**2 - 1.0], axis=1)[:, None]
    result = interpolated(times, positions, np.ones((6, 1), bool))
    np.testing.assert_allclose(result, [[0, 0, -1]], atol=0.05)


def test_positions_after_the_last_known_frame_stay():
    times = np.array([-3, -2, -1])
    positions = np.stack([times, times, times], axis=1)[:, None].astype(float)
    result = interpolated(times, positions, np.ones((3, 1), bool))
    np.testing.assert_allclose(result, [[-1, -1, -1]], atol=0.3)
