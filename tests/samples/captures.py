"""Raw captures: surfaces that move, with another mesh in every frame."""

import numpy as np

from meshreel import MeshSequence, SegmentedSequence


def capsule(n_rings, n_around, phase=0.0):
    """A closed capsule along z, of length 2 and radius 0.3, as (vertices, faces).

    Parameters
    ----------
    phase : float
        Turns the vertices around the axis, by this share of their distance.
    """
    angles = np.linspace(0, np.pi, n_rings + 2)[1:-1]
    around = 2 * np.pi * (np.arange(n_around) + phase) / n_around
    z = np.cos(angles)
    radius = 0.3 * np.minimum(1.0, np.sqrt(1 - np.abs(z) ** 8))
    rings = np.stack(
        [
            radius[:, None] * np.cos(around),
            radius[:, None] * np.sin(around),
            np.tile(z[:, None], (1, n_around)),
        ],
        axis=-1,
    )
    vertices = np.vstack([rings.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    faces = []
    for ring in range(n_rings - 1):
        for i in range(n_around):
            a, b = ring * n_around + i, ring * n_around + (i + 1) % n_around
            faces += [[a, a + n_around, b], [b, a + n_around, b + n_around]]
    top, bottom, last = len(vertices) - 2, len(vertices) - 1, (n_rings - 1) * n_around
    for i in range(n_around):
        j = (i + 1) % n_around
        faces += [[top, i, j], [bottom, last + j, last + i]]
    return vertices, np.array(faces, np.int32)


def bent(vertices, angle):
    """Bend points around the y axis by an angle that grows with z, up to this one at z = 1."""
    x, y, z = vertices.T
    turn = angle * z
    return np.stack([x * np.cos(turn) + np.sin(turn), y, z - x * np.sin(turn)], axis=1)


def capture(n_frames=6, last_angle=0.5):
    """A bending capsule whose mesh is another one in every frame, as raw frames."""
    rng = np.random.default_rng(0)
    frames = []
    for angle in np.linspace(0, last_angle, n_frames):
        mesh, faces = capsule(int(rng.integers(30, 34)), int(rng.integers(26, 30)), rng.random())
        frames.append((bent(mesh, angle), faces))
    return as_frames(frames)


def as_frames(frames, fps=25.0):
    """(vertices, faces) of each frame as a sequence of one segment per frame."""
    return SegmentedSequence(
        MeshSequence(vertices[None].astype(np.float32), faces, fps=fps)
        for vertices, faces in frames
    )
