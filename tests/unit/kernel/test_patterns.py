import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from meshreel.errors import MeshReelError
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.patterns import (
    STENCIL_SIZE,
    Predictors,
    decode_patterns,
    encode_patterns,
    face_predictors,
    linear_predictors,
    no_predictors,
    previous_predictors,
)
from samples.meshes import waving_grid

TYPES = ["u1", "i4", "f4", "f8"]
SHAPES = st.tuples(st.integers(0, 30), st.integers(1, 4))


def any_expected(n_rows, rng):
    """Return rows in any order, each predicted from earlier rows: triples, one row or a stencil."""
    order = rng.permutation(n_rows).astype(np.int32)
    triples, starts = [], [0]
    stencils = np.full((n_rows, STENCIL_SIZE), -1, np.int32)
    weights = rng.normal(size=stencils.shape).astype(np.float32)
    for i in range(n_rows):
        size = int(rng.integers(0, STENCIL_SIZE + 1)) if i and rng.random() < 0.3 else 0
        stencils[order[i], :size] = order[rng.integers(0, max(i, 1), size)]
        count = int(rng.integers(0, 4)) if i else 0
        rows = order[rng.integers(0, max(i, 1), (count, 3))]
        if count == 1 and rng.random() < 0.5:
            rows[:, 2] = -1
        triples.append(rows)
        starts.append(starts[-1] + count)
    every = np.concatenate([np.zeros((0, 3), np.int32), *triples]).astype(np.int32)
    return Predictors(order, np.array(starts, np.int64), every, stencils, weights)


@pytest.mark.parametrize("dtype", TYPES)
def test_numbers_round_trip_bit_for_bit_with_any_prediction(dtype):
    @given(arrays(dtype, SHAPES), st.integers(0, 1 << 30))
    def check(values, seed):
        expected = any_expected(len(values), np.random.default_rng(seed))
        back = decode_patterns(
            encode_patterns(values, expected), values.shape, values.dtype, expected
        )
        assert back.tobytes() == values.tobytes()

    check()


@pytest.mark.parametrize("dtype", TYPES)
def test_arbitrary_bytes_decode_or_raise_our_error(dtype):
    @given(st.binary(max_size=300), st.integers(0, 1 << 30))
    def check(data, seed):
        expected = any_expected(20, np.random.default_rng(seed))
        try:
            decoded = decode_patterns(data, (20, 3), np.dtype(dtype), expected)
        except MeshReelError:
            return
        assert decoded.shape == (20, 3)

    check()


def test_exact_parallelogram_predictions_take_few_bytes():
    rows, cols = np.divmod(np.arange(900, dtype=np.int32), 30)
    values = np.stack([3 * rows + 700 * cols, 11 * cols - rows], axis=1).astype(np.int32)
    inner = (rows > 0) & (cols > 0)
    at = np.flatnonzero(inner)
    starts = np.concatenate([[0], np.cumsum(inner)])
    triples = np.stack([at - 1, at - 30, at - 31], axis=1).astype(np.int32)
    expected = Predictors(np.arange(900, dtype=np.int32), starts, triples)
    assert len(encode_patterns(values, expected)) < 200


def test_few_distinct_rows_are_coded_as_indices():
    rng = np.random.default_rng(4)
    palette = rng.integers(0, 256, (32, 4)).astype(np.uint8)
    values = palette[rng.integers(0, 32, 4000)]
    assert 8 * len(encode_patterns(values, no_predictors(4000))) < 5.5 * 4000


def test_motion_predicted_by_its_step_takes_fewer_bytes():
    values = np.cumsum(np.cumsum(np.random.default_rng(2).normal(size=(200, 9)), axis=0), axis=0)
    plain, moving = (
        len(encode_patterns(values, expected(200)))
        for expected in (previous_predictors, linear_predictors)
    )
    assert moving < 0.97 * plain


def test_mean_of_parallelograms_is_rounded_down_within_range():
    expected = Predictors(
        np.arange(4, dtype=np.int32),
        np.array([0, 0, 0, 0, 2]),
        np.array([[0, 1, 2], [1, 1, 2]], np.int32),
    )

    def n_bytes(*last):
        first = np.array([[0, 250], [7, 250], [0, 3]], np.uint8)
        return len(encode_patterns(np.vstack([first, np.array([last], np.uint8)]), expected))

    assert n_bytes(10, 255) <= min(n_bytes(a, b) for a in (9, 11, 12) for b in (250, 254))


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.tuples(
            st.just(n), st.lists(st.tuples(*[st.integers(0, n - 1)] * 3), max_size=30)
        )
    )
)
def test_rows_are_predicted_from_earlier_rows_for_any_faces(case):
    n_rows, listed = case
    faces = np.array(listed, np.int32).reshape(-1, 3)
    twins = opposite_sides(faces, n_rows) if len(faces) else np.zeros(0, np.int64)
    expected = face_predictors(faces, twins, n_rows, np.eye(n_rows, 3))
    assert sorted(expected.order) == list(range(n_rows))
    place = np.argsort(expected.order)
    for row, stencil in enumerate(expected.stencils):
        known = stencil[stencil >= 0]
        assert (place[known] < place[row]).all()
        assert len(set(known)) == len(known)
    for i, (start, end) in enumerate(zip(expected.starts[:-1], expected.starts[1:], strict=True)):
        triples = expected.triples[start:end]
        assert (place[triples[triples >= 0]] < i).all()
        assert end - start <= 1 or (triples >= 0).all()


def test_rows_of_a_grid_are_predicted_by_parallelograms():
    n = 20
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.concatenate(
        [np.stack([a, c, b], axis=-1).reshape(-1, 3), np.stack([b, c, d], axis=-1).reshape(-1, 3)]
    )
    expected = face_predictors(faces, opposite_sides(faces, n * n), n * n)
    assert (expected.triples[:, 2] < 0).sum() <= 3
    rows, cols = np.divmod(np.arange(n * n, dtype=np.int32), n)
    values = np.stack([7 * rows + 100 * cols, rows - 3 * cols], axis=1).astype(np.int32)
    assert len(encode_patterns(values, expected)) < 60


def test_linear_functions_of_positions_take_few_bytes():
    sheet = waving_grid(1, 20, 20)
    points, faces = sheet.vertices[0].astype(np.float64), sheet.faces
    values = np.rint(points @ [[900.0, -70.0], [20.0, 800.0], [333.0, 50.0]]).astype(np.int32)
    twins = opposite_sides(faces, 400)
    flat, placed = (face_predictors(faces, twins, 400, known) for known in (None, points))
    assert len(encode_patterns(values, placed)) < 0.5 * len(encode_patterns(values, flat))
