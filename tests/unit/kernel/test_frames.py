"""Frames and basis vectors, bit for bit as `docs/format.md` defines them."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from conformance.timeline import basis_vectors as plain_basis_vectors
from meshreel.errors import InvalidInputError
from meshreel.kernel.basis import BasisCoding, basis_vectors
from meshreel.kernel.frames import FrameCorrections, JointFrames, coordinate_rows

PLACEMENT = (3.7, 0.1, -2.0, 5e3)


def sums_of_the_format(basis, fields, number=np.float64):
    """Return positions summed mode by mode, of shape (3, T, V)."""
    sums = np.zeros((*basis.shape[:2], fields.shape[1]), number)
    for mode, field in enumerate(fields.astype(number)):
        sums += basis[:, :, mode, None].astype(number) * field
    return sums.astype(np.float64)


def positions_of_the_format(sums, dtype):
    scale, *origin = PLACEMENT
    return np.moveaxis(sums * scale + np.reshape(origin, (3, 1, 1)), 0, 2).astype(dtype)


def block(n_frames, n_modes, n_verts, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(3, n_frames, n_modes)), rng.normal(size=(n_modes, n_verts))


blocks = st.builds(
    block, st.integers(1, 70), st.integers(0, 40), st.integers(1, 200), st.integers(0, 2**32)
)


numbers = st.sampled_from([np.float32, np.float64])


@given(blocks, numbers, numbers)
def test_positions_of_all_frames_follow_the_format(block, dtype, summed):
    basis, fields = block
    is_single = summed is np.float32
    out = np.empty((basis.shape[1], fields.shape[1], 3), dtype)
    joint = JointFrames(basis, fields.T, is_single=is_single)
    joint.fill(out, range(len(out)), PLACEMENT)
    sums = sums_of_the_format(basis, fields, summed)
    np.testing.assert_array_equal(out, positions_of_the_format(sums, dtype))
    np.testing.assert_array_equal(joint(slice(None)), sums)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_verts", [1, 64, 100])
@pytest.mark.parametrize("vertex", [0, -1])
def test_values_that_are_not_finite_are_found(dtype, n_verts, vertex):
    basis, fields = block(3, 2, n_verts)
    out = np.empty((3, n_verts, 3), dtype)
    assert JointFrames(basis, fields.T).fill(out, range(3), PLACEMENT)
    for value in (1e39, -1e39, 1e308, np.nan):
        fields[1, vertex] = value
        with np.errstate(over="ignore"):
            is_finite = JointFrames(1e3 * basis, fields.T).fill(out, range(3), PLACEMENT)
        assert is_finite == np.isfinite(out).all()
        assert is_finite == (dtype == np.float64 and abs(value) == 1e39)


def test_padding_of_the_last_tile_is_not_checked():
    basis, fields = block(1, 1, 65)
    fields[0, 64], basis[:] = 1e40, 1.0
    back_to_range = FrameCorrections(
        np.array([0, 1]), np.array([64], np.int32), np.full((1, 3), -1e40)
    )
    out = np.empty((1, 65, 3), np.float32)
    assert JointFrames(basis, fields.T).fill(out, range(1), PLACEMENT, back_to_range)
    assert np.isfinite(out).all()


@given(blocks, st.data())
def test_positions_do_not_depend_on_selected_frames_and_vertex_order(block, data):
    basis, fields = block
    frames = range(basis.shape[1])[data.draw(st.slices(basis.shape[1]))]
    order = np.random.default_rng(1).permutation(fields.shape[1])
    out = np.empty((len(frames), fields.shape[1], 3))
    JointFrames(basis, fields.T, order=order).fill(out, frames, PLACEMENT)
    sums = sums_of_the_format(basis, fields)[:, list(frames)][:, :, order]
    np.testing.assert_array_equal(out, positions_of_the_format(sums, np.float64))


@given(blocks, st.floats(0, 1), st.integers(0, 2**32))
def test_corrections_are_added_before_scaling(block, share, seed):
    basis, fields = block
    rng = np.random.default_rng(seed)
    frames, vertices = np.nonzero(rng.random((basis.shape[1], fields.shape[1])) < share)
    moves = rng.normal(size=(len(frames), 3))
    starts = np.searchsorted(frames, np.arange(basis.shape[1] + 1))
    corrections = FrameCorrections(starts, vertices.astype(np.int32), moves)
    sums = sums_of_the_format(basis, fields)
    sums[:, frames, vertices] += moves.T
    expected = positions_of_the_format(sums, np.float32)
    out = np.empty(expected.shape, np.float32)
    joint = JointFrames(basis, fields.T)
    joint.fill(out, range(len(out)), PLACEMENT, corrections)
    np.testing.assert_array_equal(out, expected)
    later = range(len(out) // 2, len(out))
    joint.fill(out[later.start :], later, PLACEMENT, corrections.of_frames(later))
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("order", [[0, 1, 3], [0, -1, 2]])
def test_order_is_rejected_when_a_vertex_does_not_exist(order):
    basis, fields = block(2, 2, 3)
    with pytest.raises(InvalidInputError, match="fields cannot be encoded"):
        JointFrames(basis, fields.T, order=np.array(order)).pack()


@pytest.mark.parametrize("frames", [range(-1, 1), range(1, 3)])
def test_frame_is_rejected_when_it_does_not_exist(frames):
    basis, fields = block(2, 2, 3)
    with pytest.raises(InvalidInputError, match="frames cannot be encoded"):
        JointFrames(basis, fields.T).columns(frames)


@given(blocks, numbers, st.data())
def test_layout_and_step_of_fields_give_the_same_positions(block, summed, data):
    basis, fields = block
    is_single = summed is np.float32
    together = np.ascontiguousarray(fields.T)
    step = data.draw(st.floats(1e-3, 1e3))
    result = JointFrames(basis, together, step, is_single=is_single)
    expected = JointFrames(basis, fields.T * step, is_single=is_single)
    np.testing.assert_array_equal(result(slice(None)), expected(slice(None)))


@given(st.integers(1, 40), st.integers(1, 4), st.integers(0, 2**32), st.booleans())
def test_basis_vectors_equal_those_of_a_second_implementation(n_frames, n_modes, seed, is_adaptive):
    rng = np.random.default_rng(seed)
    coded = rng.integers(-(10 ** rng.integers(1, 8)), 10**4, (n_modes, 3, n_frames))
    coded *= rng.random((n_modes, 1, 1)) < 0.9
    vectors = basis_vectors(coded, BasisCoding(is_adaptive=is_adaptive))
    rows, kind = coded.reshape(n_modes, -1).tolist(), "adaptive" if is_adaptive else ""
    expected = plain_basis_vectors(rows, n_frames, [None] * n_modes, kind=kind)
    for mode, vector in enumerate(expected):
        assert vectors[:, :, mode].ravel().tolist() == vector


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_coordinate_rows_are_positions_relative_to_the_origin(dtype):
    vertices = np.random.default_rng(2).normal(size=(5, 9, 3)).astype(dtype)
    order = np.random.default_rng(3).permutation(9).astype(np.int32)
    scale, *origin = PLACEMENT
    rows = coordinate_rows(vertices, order, slice(2, 8), PLACEMENT)
    placed = (vertices[:, order[2:8]].astype(np.float64) - origin) / scale
    expected = np.moveaxis(placed, 2, 0).reshape(15, 6)
    np.testing.assert_allclose(rows, expected, rtol=1e-14)
    signs, added = np.array([1.0, -1, 1, -1, -1, 1]), np.ones((15, 6))
    coordinate_rows(vertices, order, slice(2, 8), PLACEMENT, signs, added)
    np.testing.assert_allclose(added, 1 + signs * expected, rtol=1e-12)
