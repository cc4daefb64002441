"""Animations that bones can move."""

import numpy as np

from meshreel.model.sequence import MeshSequence

BOX = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip


def turn(angle, axis=2):
    """Return the matrix of a rotation by an angle in radians about a coordinate axis."""
    i, j = [(1, 2), (0, 2), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[[i, j], [i, j]] = np.cos(angle)
    matrix[i, j], matrix[j, i] = -np.sin(angle), np.sin(angle)
    return matrix


def boxes(motions, n_frames=12, spacing=3.0):
    """Return a sequence of boxes, each moved by a function of the frame that returns a matrix."""
    offsets = [np.array([spacing * number, 0, 0]) for number in range(len(motions))]
    frames = [
        np.concatenate(
            [
                BOX @ motion(frame).T + offset
                for motion, offset in zip(motions, offsets, strict=True)
            ]
        )
        for frame in range(n_frames)
    ]
    faces = np.concatenate([BOX_FACES + 8 * number for number in range(len(motions))])
    return MeshSequence(np.stack(frames), faces, 25.0, "boxes")


def bending_tube(n_frames=24, n_rings=24, n_around=10, bulge=0.0):
    """Return a tube whose upper half bends and twists smoothly, and bulges if requested."""
    heights = np.linspace(0, 4, n_rings)
    angles = np.linspace(0, 2 * np.pi, n_around, endpoint=False)
    ring = np.stack([0.5 * np.cos(angles), 0.5 * np.sin(angles), 0 * angles], axis=1)
    rest = np.concatenate([ring + np.array([0, 0, height]) for height in heights])
    share = np.clip((rest[:, 2] - 1.5), 0, 1)[:, np.newaxis]
    joint = np.array([0, 0, 2.0])
    frames = []
    for phase in np.linspace(0, 2 * np.pi, n_frames):
        bent = (rest - joint) @ (turn(0.7 * np.sin(phase), 0) @ turn(0.4 * np.sin(phase))).T + joint
        swollen = 1 + bulge * np.sin(2 * phase) * np.exp(-4 * np.square(rest[:, 2:] - 1))
        wide = rest * np.where([[1, 1, 0]], swollen, 1)
        frames.append((1 - share) * wide + share * bent)
    first = np.arange(n_around * (n_rings - 1)).reshape(n_rings - 1, n_around)
    following = np.roll(first, -1, axis=1)
    lower = np.stack([first, following, following + n_around], axis=2)
    upper = np.stack([first, following + n_around, first + n_around], axis=2)
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)]).astype(np.int32)
    return MeshSequence(np.stack(frames).astype(np.float32), faces, 25.0, "tube")
