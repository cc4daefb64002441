"""Corrections bring every position within a bound."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.codec.reel.encoding import corrections as module
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.corrections import (
    FLOOR,
    corrections_of_block,
    find_corrections,
)
from meshreel.codec.reel.normative.blocks import Corrections
from meshreel.codec.subspace.trajectories import BoundingFrame


def some_errors(n_frames=7, n_verts=11, size=1.0, seed=0):
    return size * np.random.default_rng(seed).normal(size=(3, n_frames, n_verts))


def left_over(errors, corrections):
    """Errors after correction, of shape (3, T, V)."""
    left = errors.copy()
    left[:, corrections.frames, corrections.vertices] -= corrections.displacements.T
    return left


@given(
    st.integers(1, 9),
    st.integers(1, 12),
    st.sampled_from([1e-6, 0.01, 0.9, 1.1, 4.0, 1e3, 1e8]),
    st.sampled_from([1e-7, 1e-3, 2.0]),
    st.floats(0.0, 0.9),
    st.integers(0, 2**32 - 1),
)
def test_every_position_is_within_the_bound_for_any_errors(
    n_frames, n_verts, size, bound, share, seed
):
    """Part of the bound is reserved for rounding."""
    errors = some_errors(n_frames, n_verts, size * bound, seed)
    corrections = find_corrections(errors, bound, share * bound)
    lengths = np.linalg.norm(left_over(errors, corrections), axis=0)
    assert lengths.max() <= (bound - FLOOR - share * bound) * (1 + 1e-9) + 1e-15 * size * bound


@given(st.lists(st.integers(-5, 5), min_size=3, max_size=3), st.sampled_from([-1, 0, 1]))
def test_corners_of_a_cell_are_within_the_bound(cell, side):
    """Errors half-way between two steps along each axis are the worst case."""
    step = float(find_corrections(np.zeros((3, 1, 1)), 1.0, 0.0).step)
    errors = (np.array(cell) + 0.5 + 1e-9 * side).reshape(3, 1, 1) * step
    left = left_over(errors, find_corrections(errors, 1.0, 0.0))
    assert np.linalg.norm(left, axis=0).max() <= 1.0 - FLOOR


def test_floor_is_reserved_when_the_bound_is_tiny():
    errors, bound = np.zeros((3, 1, 3)), 10 * FLOOR
    errors[0, 0] = [bound - 1.1 * FLOOR, bound - 0.9 * FLOOR, bound]
    np.testing.assert_array_equal(find_corrections(errors, bound, 0.0).vertices, [1, 2])


@pytest.mark.parametrize("size", [0.0, 0.1, 0.5])
def test_no_corrections_when_all_errors_are_within_the_bound(size):
    errors = size / np.sqrt(3) * np.ones((3, 4, 5))
    corrections = find_corrections(errors, 0.6, 0.01)
    assert corrections.vertices.shape == corrections.frames.shape == (0,)
    assert corrections.offsets.shape == (0, 3)


def test_only_errors_beyond_the_bound_are_corrected():
    errors = some_errors()
    corrections = find_corrections(errors, 1.5, 0.0)
    is_far = np.linalg.norm(errors, axis=0) > 1.5 - FLOOR
    result = np.zeros_like(is_far)
    result[corrections.frames, corrections.vertices] = True
    assert 0 < is_far.sum() < is_far.size
    np.testing.assert_array_equal(result, is_far)


def test_corrections_are_ordered_by_vertex_then_frame():
    corrections = find_corrections(some_errors(), 1.2, 0.0)
    places = corrections.vertices * 7 + corrections.frames
    assert np.all(np.diff(places) > 0)


def test_corrections_found_in_several_passes_are_those_of_one(monkeypatch):
    vertices = np.ascontiguousarray(some_errors().transpose(1, 2, 0))
    block = BlockFrames(vertices, BoundingFrame((0.0, 0.0, 0.0), 1.0))

    def at_origin(piece):
        return np.zeros((3, piece.stop - piece.start, block.n_verts))

    whole = corrections_of_block(block, at_origin, 1.2, 0.0)
    assert 0 < len(whole.vertices) < block.n_frames * block.n_verts
    monkeypatch.setattr(module, "MAX_POSITIONS_PER_PASS", 3 * block.n_verts)
    parts = corrections_of_block(block, at_origin, 1.2, 0.0)
    for name in ("vertices", "frames", "offsets"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


def test_corrections_use_the_step_as_decoded():
    """The step is rounded to float32 before offsets are computed, as in the decoder."""
    corrections = find_corrections(some_errors(), 1 / 3, 0.0)
    assert corrections.step.dtype == np.float32


def test_errors_are_not_modified():
    errors = some_errors()
    find_corrections(errors, 0.1, 0.0)
    np.testing.assert_array_equal(errors, some_errors())


def test_offsets_are_whole_steps():
    nothing = np.zeros(2, np.int64)
    corrections = Corrections(np.float32(0.25), nothing, nothing, np.array([[1, 0, -2], [4, 3, 0]]))
    np.testing.assert_array_equal(corrections.displacements, [[0.25, 0, -0.5], [1, 0.75, 0]])
