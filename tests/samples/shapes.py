"""Simple shapes as (vertices, faces), and closest points on them by brute force."""

import numpy as np

from samples.meshes import grid_faces


def square(height=0.0, n=2):
    """The unit square at a height, of n x n vertices; its normal is +z."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    return np.stack([x.ravel(), y.ravel(), np.full(n * n, height)], axis=1), grid_faces(n, n)


def cube():
    """The cube from 0 to 1, of 8 vertices and 12 faces with outward normals."""
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([[q[0], *q[i : i + 2]] for q in quads for i in (1, 2)], np.int32)


def torus(n_rows=24, n_columns=48, bend=0.0):
    """A torus of radii 1 and 0.4, cut open; `bend` adds smooth waves."""
    u, v = np.meshgrid(
        np.linspace(0, 2 * np.pi, n_columns), np.linspace(0, 2 * np.pi, n_rows), indexing="ij"
    )
    tube = 0.4 + bend * np.sin(7 * u) * np.cos(3 * v)
    ring = 1 + tube * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], axis=-1)
    return points.reshape(-1, 3), grid_faces(n_columns, n_rows)


def split_at_centroids(vertices, faces):
    """Split each face into three at its centroid."""
    centers = len(vertices) + np.arange(len(faces))
    parts = [np.stack([faces[:, i], faces[:, (i + 1) % 3], centers], 1) for i in range(3)]
    split = np.concatenate([vertices, vertices[faces].mean(axis=1)])
    return split, np.concatenate(parts).astype(np.int32)


def closest_by_brute_force(points, corners):
    """Distance of each point to each triangle, of shape (N, M), in extended precision."""
    points = np.asarray(points, np.longdouble)[:, None]
    a, b, c = (np.asarray(corners, np.longdouble)[None, :, k] for k in range(3))
    distances = np.minimum.reduce(
        [_to_segments(points, a, b), _to_segments(points, b, c), _to_segments(points, c, a)]
    )
    normals = np.cross(b - a, c - a)
    lengths = np.sqrt((normals**2).sum(axis=-1))
    has_area = lengths > 0
    lengths = np.where(has_area, lengths, 1)
    is_above = has_area & np.logical_and.reduce(
        [
            (np.cross(t - s, points - s) * normals).sum(axis=-1) >= 0
            for s, t in ((a, b), (b, c), (c, a))
        ]
    )
    heights = np.abs(((points - a) * normals).sum(axis=-1)) / lengths
    return np.where(is_above, np.minimum(heights, distances), distances)


def _to_segments(points, starts, ends):
    along = ends - starts
    squares = (along**2).sum(axis=-1)
    shares = ((points - starts) * along).sum(axis=-1) / np.where(squares > 0, squares, 1)
    nearest = starts + np.clip(shares, 0, 1)[..., None] * along
    return np.sqrt(((points - nearest) ** 2).sum(axis=-1))
