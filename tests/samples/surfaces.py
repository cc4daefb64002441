"""Deterministic surfaces shared by tests, and their comparison."""

import numpy as np

from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Part, Surface

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
CUBE_SIZES = (4, 4, 4, 4, 3, 3, 4)
CUBE_FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7],
              [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip


def rich_cube(n_frames=3, *, attributes=(), groups=(), parts=(), dtype=np.float32):
    """Return a growing cube of quads and two triangles, with these attributes, groups and parts."""
    scale = 1 + np.arange(n_frames)[:, None, None] / 7
    vertices = (CUBE * scale).astype(dtype)
    surface = Surface(np.array(CUBE_SIZES), tuple(attributes), tuple(groups), tuple(parts))
    return MeshSequence(vertices, np.array(CUBE_FACES), surface=surface)


N_ITEMS = {Domain.VERTEX: 8, Domain.FACE: 7, Domain.CORNER: 26}


def attribute(kind, domain, width, dtype=np.float32, *, name="", rows=0):
    """Return an attribute of the cube with full-precision values; indexed if it has rows."""
    rng = np.random.default_rng(width)
    n_items = N_ITEMS[Domain(domain)]
    values = rng.random((rows or n_items, width))
    if np.dtype(dtype).kind != "f":
        values = values * 256
    indices = rng.integers(0, rows, n_items).astype(np.int32) if rows else None
    return Attribute(name or kind.value, kind, Domain(domain), values.astype(dtype), indices)


def srgb(linear):
    """Return linear colors of shape (..., C) in sRGB, as IEC 61966-2-1 defines it, as float32."""
    result = np.array(linear, np.float64)
    rgb = result[..., :3]
    result[..., :3] = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055)
    return result.astype(np.float32)


def groups(name, labels, numbers):
    """Return face groups of the cube."""
    return FaceGroups(name, tuple(labels), np.array(numbers, np.int32))


def two_cubes(n_frames=3):
    """Return two disjoint parts with slashes in their names."""
    one = rich_cube(n_frames)
    vertices = np.concatenate([one.vertices, one.vertices + 2], axis=1)
    faces = np.concatenate([one.faces, one.faces + 8])
    parts = (Part("/root/left", 8, 7), Part("/root/right", 8, 7))
    surface = Surface(np.array(CUBE_SIZES * 2), parts=parts)
    return MeshSequence(vertices, faces, surface=surface)
