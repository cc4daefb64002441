"""Surfaces with two layers that are nearer than the tolerance."""

import numpy as np
import pytest

from meshreel.registration.register import register
from meshreel.registration.triangle_mesh import TriangleMesh
from samples.captures import as_frames
from samples.shapes import cube

THICKNESS = 0.001


def plate(n_rows, n_columns, phase, rng):
    """A waving plate of side 1: a square grid on each side, and faces around them."""
    x, y = np.meshgrid(np.linspace(0, 1, n_rows), np.linspace(0, 1, n_columns), indexing="ij")
    inside = (x > 0) & (x < 1) & (y > 0) & (y < 1)
    x = x + 0.4 / n_rows * (rng.random(x.shape) - 0.5) * inside
    y = y + 0.4 / n_columns * (rng.random(y.shape) - 0.5) * inside
    low = np.stack([x, y, 0.1 * np.sin(5 * x + phase) + 0.05 * np.cos(4 * y - phase)], axis=-1)
    grid = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    )
    top = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([grid[:, 0], grid[-1, 1:], grid[-2::-1, -1], grid[0, -2:0:-1]])
    after, below = np.roll(rim, -1), rim + x.size
    rows = [[rim, below, after], [after, below, np.roll(below, -1)]]
    around = np.concatenate([np.stack(row, axis=1) for row in rows])
    vertices = np.concatenate([low + THICKNESS * np.eye(3)[2], low]).reshape(-1, 3)
    return vertices, np.concatenate([top, top[:, ::-1] + x.size, around]).astype(np.int32)


@pytest.mark.slow
def test_layers_of_a_thin_plate_stay_apart():
    rng = np.random.default_rng(0)
    frames = [
        plate(int(rng.integers(50, 54)), int(rng.integers(50, 54)), 0.15 * number, rng)
        for number in range(4)
    ]
    found = register(as_frames(frames), tolerance=0.2)
    [segment] = found.segments
    assert found.distances.psnr_db > 80
    for positions in segment.positions:
        mesh = TriangleMesh(positions.astype(float), segment.key_mesh.mesh.faces)
        is_top = mesh.face_normals[:, 2] > 0.5
        other = TriangleMesh(mesh.vertices, mesh.faces[mesh.face_normals[:, 2] < -0.5])
        heights = mesh.centroids[is_top, 2] - other.closest(mesh.centroids[is_top]).points[:, 2]
        assert (heights > 0).mean() > 0.99


def test_edges_are_boundaries_and_sharp_creases():
    vertices, faces = cube()
    assert TriangleMesh(vertices, faces).is_edge.all()
    fan = TriangleMesh(
        np.array([[0, 0, 0.1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], float),
        np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]], np.int32),
    )
    np.testing.assert_array_equal(fan.is_edge, [False, True, True, True, True])
