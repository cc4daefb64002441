"""Trajectories of large meshes, estimated from a sketch of their vertices."""

import numpy as np
import pytest

from meshreel.codec.reel.encoding.block_frames import CHUNK_VERTICES, BlockFrames
from meshreel.codec.subspace.trajectories import BoundingFrame

N_FRAMES, N_VERTS = 10, 8192
UNIT = BoundingFrame((0.0, 0.0, 0.0), 1.0)


@pytest.fixture
def frames():
    """Twelve motions over all vertices, each half as strong as the previous one, and noise."""
    rng = np.random.default_rng(3)
    motions = rng.standard_normal((3 * N_FRAMES, 12)) * 0.5 ** np.arange(12)
    matrix = motions @ rng.standard_normal((12, N_VERTS))
    matrix += 1e-5 * rng.standard_normal(matrix.shape)
    return np.ascontiguousarray(matrix.reshape(3, N_FRAMES, N_VERTS).transpose(1, 2, 0))


def rows_of(frames):
    """The matrix of shape (3 T, V) of trajectories."""
    return frames.transpose(2, 0, 1).reshape(-1, frames.shape[1])


def left_by(vectors, rows):
    """Norm of the residual of modes with these basis vectors."""
    return np.linalg.norm(rows - vectors @ (vectors.T @ rows))


@pytest.mark.parametrize("n_modes", [1, 4, 11])
def test_modes_of_a_sketch_are_nearly_optimal(frames, n_modes):
    rows = rows_of(frames)
    best = np.linalg.svd(rows, full_matrices=False)[0][:, :n_modes]
    _, vectors = BlockFrames(frames, UNIT).trajectories(0.0)
    result = vectors[:, :n_modes]
    np.testing.assert_allclose(result.T @ result, np.eye(n_modes), atol=1e-9)
    assert left_by(best, rows) <= left_by(result, rows) < 1.01 * left_by(best, rows)


def test_strengths_are_exact_when_a_sketch_has_more_than_half_as_many_columns(frames):
    few = np.ascontiguousarray(frames[:, : 2 * CHUNK_VERTICES - 1])
    strengths, _ = BlockFrames(few, UNIT).trajectories(0.01)
    exact = np.linalg.svd(rows_of(few), compute_uv=False)[: len(strengths)]
    np.testing.assert_allclose(strengths, exact, rtol=1e-9)


def test_sketch_captures_motion_of_few_vertices(frames):
    rng = np.random.default_rng(4)
    frames[:, 5000:5003] += rng.standard_normal((N_FRAMES, 1, 3))
    rows = rows_of(frames)
    strengths, vectors = BlockFrames(frames, UNIT).trajectories(0.5)
    of_few = rows[:, 5000:5003]
    assert strengths[-1] > 0.5
    assert left_by(vectors, of_few) < 0.2 * np.linalg.norm(of_few)


def test_strengths_and_energy_are_those_of_all_vertices(frames):
    rows = rows_of(frames)
    block = BlockFrames(frames, UNIT)
    strengths, _ = block.trajectories(1.0)
    exact = np.linalg.svd(rows, compute_uv=False)[: len(strengths)]
    np.testing.assert_allclose(strengths, exact, rtol=0.1)
    assert block.energy == pytest.approx(np.sum(rows**2), rel=1e-12)


def test_sketch_is_deterministic(frames):
    one, other = (BlockFrames(frames, UNIT).trajectories(0.01) for _ in range(2))
    np.testing.assert_array_equal(one[1], other[1])
