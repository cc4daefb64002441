"""Corrections keep every position within a bound, whatever was wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.codec.corrections import Corrections, corrected
from meshreel.codec.frame_products import product_frames
from meshreel.reel.agreed import payloads
from meshreel.reel.encoding.corrections import (
    FLOOR,
    allowed_error,
    find_corrections,
    least_bound,
)


def some_errors(n_frames=7, n_verts=11, size=1.0, seed=0):
    return size * np.random.default_rng(seed).normal(size=(3, n_frames, n_verts))


def left_over(errors, corrections):
    """Errors after correction, of shape (3, T, V)."""
    left = errors.copy()
    left[:, corrections.frames, corrections.vertices] -= corrections.moves.T
    return left


@given(
    st.integers(1, 9),
    st.integers(1, 12),
    st.sampled_from([1e-6, 0.01, 0.9, 1.1, 4.0, 1e3, 1e8]),
    st.sampled_from([1e-7, 1e-3, 2.0]),
    st.floats(0.0, 0.9),
    st.integers(0, 2**32 - 1),
)
def test_every_position_is_within_the_bound_whatever_the_errors(
    n_frames, n_verts, size, bound, share, seed
):
    """A share of the bound belongs to the rounding of the number type."""
    errors = some_errors(n_frames, n_verts, size * bound, seed)
    corrections = find_corrections(errors, bound, share * bound)
    lengths = np.linalg.norm(left_over(errors, corrections), axis=0)
    assert lengths.max() <= allowed_error(bound, share * bound) * (1 + 1e-9) + 1e-15 * size * bound


@given(st.lists(st.integers(-5, 5), min_size=3, max_size=3), st.sampled_from([-1, 0, 1]))
def test_worst_places_of_a_cell_are_within_the_bound_when_corrected(cell, side):
    """Halfway between two steps along each axis is the farthest from any correction."""
    step = float(find_corrections(np.zeros((3, 1, 1)), 1.0, 0.0).step)
    errors = (np.array(cell) + 0.5 + 1e-9 * side).reshape(3, 1, 1) * step
    left = left_over(errors, find_corrections(errors, 1.0, 0.0))
    assert np.linalg.norm(left, axis=0).max() <= 1.0 - FLOOR


def test_floor_is_kept_free_when_the_bound_is_tiny():
    errors, bound = np.zeros((3, 1, 3)), 10 * FLOOR
    errors[0, 0] = [bound - 1.1 * FLOOR, bound - 0.9 * FLOOR, bound]
    np.testing.assert_array_equal(find_corrections(errors, bound, 0.0).vertices, [1, 2])


@pytest.mark.parametrize("rounding", [0.0, 1e-18, FLOOR, 1e-5, 1.0])
def test_least_bound_leaves_nothing_and_more_leaves_something(rounding):
    least = least_bound(rounding)
    assert allowed_error(least, rounding) == pytest.approx(0.0, abs=1e-15)
    assert allowed_error(1.01 * least, rounding) > 0


@pytest.mark.parametrize("size", [0.0, 0.1, 0.5])
def test_there_are_no_corrections_when_nothing_is_beyond_the_bound(size):
    errors = size / np.sqrt(3) * np.ones((3, 4, 5))
    corrections = find_corrections(errors, 0.6, 0.01)
    assert corrections.vertices.shape == corrections.frames.shape == (0,)
    assert corrections.offsets.shape == (0, 3)
    matrices = some_errors(4, 5)
    frames_of = corrected(lambda frames: matrices[:, frames].copy(), corrections, None)
    np.testing.assert_array_equal(frames_of(slice(None)), matrices)


def test_only_what_is_beyond_the_bound_is_corrected():
    errors = some_errors()
    corrections = find_corrections(errors, 1.5, 0.0)
    is_far = np.linalg.norm(errors, axis=0) > allowed_error(1.5, 0.0)
    found = np.zeros_like(is_far)
    found[corrections.frames, corrections.vertices] = True
    assert 0 < is_far.sum() < is_far.size
    np.testing.assert_array_equal(found, is_far)


def test_corrections_go_by_vertex_then_frame():
    corrections = find_corrections(some_errors(), 1.2, 0.0)
    places = corrections.vertices * 7 + corrections.frames
    assert np.all(np.diff(places) > 0)


def test_steps_are_as_the_decoder_reads_them_when_corrections_are_found():
    """The step is rounded to float32 before offsets are: both sides move by the same."""
    corrections = find_corrections(some_errors(), 1 / 3, 0.0)
    assert corrections.step.dtype == np.float32
    back = payloads.read_corrections(payloads.write_corrections(corrections), 3, 7, 11)
    np.testing.assert_array_equal(back.moves, corrections.moves)


def moved_slowly(matrices, corrections, order):
    """Frames with their corrections, one after another; V of `matrices` in the order given."""
    expected = matrices.copy()
    places = {int(vertex): place for place, vertex in enumerate(order)}
    for vertex, frame, move in zip(
        corrections.vertices, corrections.frames, corrections.moves, strict=True
    ):
        expected[:, frame, places[int(vertex)]] += move
    return expected


@pytest.mark.parametrize("is_ordered", [False, True])
@pytest.mark.parametrize(
    "frames",
    [slice(None), slice(0, 7), slice(0, 1), slice(2, 5), slice(6, 7), slice(3, None), slice(4)],
    ids=str,
)
def test_frames_are_moved_where_they_belong_whatever_the_range(frames, is_ordered):
    rng = np.random.default_rng(5)
    order = rng.permutation(11) if is_ordered else np.arange(11)
    corrections = find_corrections(some_errors(), 1.2, 0.0)
    matrices = rng.normal(size=(3, 7, 11))
    frames_of = corrected(
        lambda wanted: matrices[:, wanted].copy(), corrections, order if is_ordered else None
    )
    expected = moved_slowly(matrices, corrections, order)[:, frames]
    np.testing.assert_allclose(frames_of(frames), expected, rtol=0, atol=1e-12)


def test_ranges_are_the_same_when_they_are_asked_for_in_any_order():
    """Threads expand ranges as they come."""
    basis, fields = some_errors(7, 2, seed=1), some_errors(2, 11, seed=2)[:1]
    corrections = find_corrections(some_errors(), 1.2, 0.0)
    frames_of = corrected(product_frames(basis, fields), corrections, None)
    whole = frames_of(slice(None))
    for start in (6, 0, 3, 0, 5):
        part = frames_of(slice(start, start + 1))
        np.testing.assert_allclose(part, whole[:, start : start + 1], atol=1e-12)


def test_what_is_given_stays_as_it_is_when_frames_are_corrected():
    basis, fields = some_errors(7, 2, seed=1), some_errors(2, 11, seed=2)[:1]
    order = np.random.default_rng(3).permutation(11)
    corrections = find_corrections(some_errors(), 1.2, 0.0)
    before = [array.copy() for array in (basis, fields, order, corrections.offsets)]
    corrected(product_frames(basis, fields), corrections, order)(slice(1, 6))
    for array, copy in zip((basis, fields, order, corrections.offsets), before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_errors_stay_as_they_are_when_corrections_are_found():
    errors = some_errors()
    find_corrections(errors, 0.1, 0.0)
    np.testing.assert_array_equal(errors, some_errors())


def test_moves_are_whole_steps():
    nothing = np.zeros(2, np.int64)
    corrections = Corrections(np.float32(0.25), nothing, nothing, np.array([[1, 0, -2], [4, 3, 0]]))
    np.testing.assert_array_equal(corrections.moves, [[0.25, 0, -0.5], [1, 0.75, 0]])
