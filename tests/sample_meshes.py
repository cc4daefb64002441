"""Small meshes and animations that tests share; made here, deterministic."""

import numpy as np

from meshreel.sequence import MeshSequence


def grid_faces(rows, columns):
    """Triangles of a grid of rows x columns vertices."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    below = corner + columns
    return np.concatenate(
        [np.stack([corner, below, corner + 1], 1), np.stack([corner + 1, below, below + 1], 1)]
    ).astype(np.int32)


def waving_grid(n_frames=12, rows=9, columns=11, dtype=np.float32):
    """A sheet with travelling waves: one component, with a boundary."""
    y, x = np.mgrid[0:rows, 0:columns] / 8.0
    time = np.arange(n_frames)[:, None, None] / 5.0
    height = 0.2 * np.sin(4 * x - 2 * time) + 0.1 * np.cos(5 * y + 3 * time) * x
    vertices = np.stack(np.broadcast_arrays(x + 0.05 * time, y, height), axis=-1)
    return MeshSequence(
        vertices.reshape(n_frames, -1, 3).astype(dtype), grid_faces(rows, columns), 25.0, "grid"
    )


def octahedron_faces():
    """A closed surface of six vertices."""
    return np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
        np.int32,
    )


def irregular_sequence(n_frames=8):
    """Two components, isolated vertices, degenerate, duplicate and non-manifold faces."""
    grid = waving_grid(n_frames, 5, 6, np.float64)
    rng = np.random.default_rng(7)
    body = rng.normal(size=(6, 3))
    path = np.cumsum(rng.normal(size=(n_frames, 1, 3)), axis=0)
    loose = rng.normal(size=(n_frames, 2, 3))
    vertices = np.concatenate([loose[:, :1], grid.vertices, body + path, loose[:, 1:]], axis=1)
    extra = [[3, 3, 4], [1, 2, 7], [1, 2, 7], [2, 3, 20], [5, 5, 5]]
    faces = np.concatenate([grid.faces + 1, octahedron_faces() + 31, extra])
    return MeshSequence(vertices, faces, 30.0, "irregular")


def kg_error_percent(original, decoded):
    """KG error of two position arrays, written out here so that it can check the library's."""
    original = np.asarray(original, np.float64)
    centred = original - original.mean(axis=1, keepdims=True)
    return 100 * np.linalg.norm(original - decoded) / np.linalg.norm(centred)
