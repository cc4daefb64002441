import numpy as np
import pytest

from meshreel.codec.subspace.trajectories import (
    BoundingFrame,
    bounding_frame,
    from_matrices,
    to_matrices,
)
from meshreel.model.extent import extent_of


@pytest.mark.parametrize(("offset", "size"), [(0.0, 1.0), (1e6, 1.0), (0.0, 1e-6), (-5e8, 1e3)])
def test_matrices_are_invariant_to_translation_and_scale(offset, size):
    shape = np.random.default_rng(1).uniform(size=(4, 10, 3))
    here = to_matrices(shape, bounding_frame(extent_of(shape)))
    moved = shape * size + offset
    there = to_matrices(moved, bounding_frame(extent_of(moved)))
    np.testing.assert_allclose(there, here, atol=4 * np.finfo(float).eps * (1 + abs(offset) / size))


def test_positions_are_restored_from_matrices():
    shape = np.random.default_rng(1).uniform(size=(4, 10, 3)) + 100
    frame = bounding_frame(extent_of(shape))
    back = from_matrices(to_matrices(shape, frame), frame, np.float64)
    np.testing.assert_allclose(back, shape, atol=1e-13)


def test_scale_of_coincident_vertices_is_one():
    assert bounding_frame(extent_of(np.full((2, 3, 3), 7.0))).scale == 1.0


def test_to_matrices_does_not_modify_its_input():
    vertices = np.array([[[1.0, 2.0, 4.0]]])
    to_matrices(vertices, BoundingFrame((1.0, 1.0, 1.0), 2.0))
    np.testing.assert_array_equal(vertices, [[[1.0, 2.0, 4.0]]])
