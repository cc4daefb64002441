"""Raw captures: surfaces that move, with another mesh in every frame."""

import numpy as np
from PIL import Image as PillowImage

from meshreel import Attribute, Domain, Kind, MeshSequence, Surface


def capsule(n_rings, n_around, phase=0.0):
    """A closed capsule along z, of length 2 and radius 0.3, as (vertices, faces).

    Parameters
    ----------
    phase : float
        Turns the vertices around the axis, by this share of their distance.
    """
    z = np.cos(np.linspace(0, np.pi, n_rings + 2))
    return revolved(0.3 * np.minimum(1.0, np.sqrt(1 - np.abs(z[1:-1]) ** 8)), z, n_around, phase)


def revolved(radius, z, n_around, phase=0.0):
    """A closed surface around the z axis, as (vertices, faces).

    Parameters
    ----------
    radius : float array of shape (R,)
        Of each ring.
    z : float array of shape (R + 2,)
        Heights of the top, the rings and the bottom, descending.
    """
    around, n_rings = 2 * np.pi * (np.arange(n_around) + phase) / n_around, len(radius)
    rings = np.stack(
        [
            radius[:, None] * np.cos(around),
            radius[:, None] * np.sin(around),
            np.tile(z[1:-1, None], (1, n_around)),
        ],
        axis=-1,
    )
    vertices = np.vstack([rings.reshape(-1, 3), [[0, 0, z[0]], [0, 0, z[-1]]]])
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


def merging_spheres(distance, n_around, phase=0.0):
    """Two spheres of radius 1 along z; their union where they overlap, as a scanner sees it."""
    n_rings = n_around // 2
    if distance > 2:
        z = np.cos(np.linspace(0, np.pi, n_rings + 2))
        one, faces = revolved(np.sqrt(1 - z[1:-1] ** 2), z, n_around, phase)
        offset = np.array([0, 0, distance / 2])
        return np.concatenate([one + offset, one - offset]), np.vstack([faces, faces + len(one)])
    waist = np.arccos(-distance / 2)  # angle at the center from the pole to the other sphere
    z = distance / 2 + np.cos(np.linspace(0, waist, n_rings + 1))
    z = np.concatenate([z, -z[-2::-1]])
    return revolved(np.sqrt(1 - (np.abs(z[1:-1]) - distance / 2) ** 2), z, n_around, phase)


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
    return MeshSequence.of_segments(
        MeshSequence(vertices[None].astype(np.float32), faces, fps=fps)
        for vertices, faces in frames
    )


def unbent(points, angle):
    """Undo `bent` by fixed-point iteration."""
    result = points.astype(float)
    for _ in range(50):
        result = result + points - bent(result, angle)
    return result


def textured_capture(n_frames=4, last_angle=0.3, side=128):
    """A bending capsule with a texture, as raw frames and an image of each.

    The texture coordinates of each frame are the angle around the axis and the height, placed at
    another position of the image. The colors, `color_at`, move with the surface.
    """
    rng, frames, images = np.random.default_rng(0), [], []
    for number, angle in enumerate(np.linspace(0, last_angle, n_frames)):
        mesh, faces = capsule(int(rng.integers(30, 34)), int(rng.integers(26, 30)), rng.random())
        scale, offset = np.array([0.6, 0.7]), np.array([0.05, 0.2]) * number / n_frames + 0.02
        uv = np.float32(_chart(mesh, faces) * scale + offset)
        surface = Surface(attributes=(Attribute("uv", Kind.UV, Domain.CORNER, uv),))
        vertices = bent(mesh, angle)[None].astype(np.float32)
        frames.append(MeshSequence(vertices, faces, 25.0, surface=surface))
        across = (np.arange(side) + 0.5) / side
        u, v = np.meshgrid(across, 1 - across)
        u, v = (u - offset[0]) / scale[0], (v - offset[1]) / scale[1]
        images.append(PillowImage.fromarray(_color(2 * np.pi * u, 2 * v - 1)))
    return MeshSequence.of_segments(frames), images


def _chart(mesh, faces):
    """Angle and height of each corner, 0..1 but for faces across the seam, of shape (3 M, 2)."""
    corners = mesh[faces]
    angles = np.arctan2(corners[..., 1], corners[..., 0]) / (2 * np.pi) % 1
    on_axis = np.hypot(corners[..., 0], corners[..., 1]) < 1e-6
    angles[(np.ptp(np.where(on_axis, 0.5, angles), axis=1) > 0.5)[:, None] & (angles < 0.5)] += 1
    others = np.where(on_axis, 0, angles).sum(axis=1) / np.maximum((~on_axis).sum(axis=1), 1)
    angles = np.where(on_axis, others[:, None], angles)
    return np.stack([angles, (corners[..., 2] + 1) / 2], axis=-1).reshape(-1, 2)


def color_at(points, angle):
    """The color of points of the capsule, bent by an angle; uint8 of shape (N, 3)."""
    x, y, z = unbent(points, angle).T
    return _color(np.arctan2(y, x), z)


def _color(around, height):
    channels = [np.sin(around), np.cos(around), np.sin(4 * height)]
    return np.rint(128 + 100 * np.stack(channels, axis=-1)).astype(np.uint8)
