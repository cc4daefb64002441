import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel.codec.entropy.tables import (
    ALONG_FACES,
    BIT_PATTERNS,
    GRID,
    INTEGER,
    MAX_GRID_BITS,
    MAX_INTEGER,
    OFFSET_GRID,
    ON_SURFACE,
    UNORM16,
    encode_grid_table,
    encode_table,
    values_of,
)
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.patterns import (
    decode_patterns,
    face_predictors,
    no_predictors,
    previous_predictors,
)
from samples.coded_meshes import decode_on_surface
from samples.meshes import grid_faces

CODES = (*range(UNORM16 + 1), *range(GRID, GRID + MAX_GRID_BITS + 1))
SINGLE = np.dtype(np.float32)
SHAPES = st.tuples(st.integers(0, 12), st.integers(1, 4))


def decoded(data, shape, dtype, faces=None):
    """The table, with its form and coding in the first bytes."""
    form, size = data[0], 4 * (1 + shape[1]) if data[0] == OFFSET_GRID else 0
    coding, coded = data[1 + size], data[2 + size :]
    if form == BIT_PATTERNS:
        return integers_or_patterns(coded, coding, shape, dtype, faces)
    integers = integers_or_patterns(coded, coding, shape, INTEGER, faces)
    if form != OFFSET_GRID:
        return values_of(integers, form, dtype)
    step, *origins = np.frombuffer(data[1 : 1 + size], "<f4")
    return np.array(origins, np.float32) + integers.astype(np.float32) * step


def integers_or_patterns(coded, coding, shape, dtype, faces):
    if coding < ALONG_FACES:
        expected = (no_predictors, previous_predictors)[coding](shape[0])
        return decode_patterns(coded, shape, dtype, expected)
    twins = opposite_sides(faces, shape[0])
    if coding == ON_SURFACE:
        return decode_on_surface(coded, shape, faces, twins)
    return decode_patterns(coded, shape, dtype, face_predictors(faces, twins, shape[0]))


def assert_round_trips(values):
    back = decoded(encode_table(values), values.shape, values.dtype)
    assert back.dtype == values.dtype
    assert back.tobytes() == values.tobytes()


@pytest.mark.parametrize("dtype", ["u1", "i4", "f4", "f8"])
def test_tables_of_any_type_are_lossless(dtype):
    @given(arrays(dtype, SHAPES))
    def check(values):
        assert_round_trips(values)

    check()


@given(arrays(np.int64, SHAPES, elements=st.integers(-(10**8), 10**8)), st.integers(0, 9))
def test_decimals_rounded_to_float32_are_lossless(integers, places):
    assert_round_trips((integers / 10.0**places).astype(np.float32))


@pytest.mark.every_case
@pytest.mark.parametrize(
    "values",
    [
        [[0.5], [-0.0], [0.0]],
        [[200 * np.finfo(np.float32).smallest_subnormal], [-0.0]],
        np.full((5, 2), 0.1),
        [[np.finfo(np.float32).max], [-np.finfo(np.float32).max]],
    ],
    ids=["signs of zero", "range without a step", "constant", "whole range"],
)
def test_singular_ranges_are_lossless(values):
    assert_round_trips(np.array(values, np.float32))


def test_decimals_with_few_places_take_fewer_bytes():
    values = (np.random.default_rng(0).integers(0, 10**4, (5000, 2)) / 1e4).astype(np.float32)
    assert len(encode_table(values)) < 0.5 * values.nbytes


@pytest.mark.parametrize("code", CODES)
def test_multiples_of_any_form_take_the_bytes_of_their_integers(code):
    integers = np.random.default_rng(code).integers(0, 200, (3000, 2)).astype(np.int32)
    values = values_of(integers, code, SINGLE)
    assert_round_trips(values)
    assert len(encode_table(values)) < 1.05 * len(encode_table(integers)) + 8


@given(
    arrays(np.int64, SHAPES, elements=st.integers(-MAX_INTEGER, MAX_INTEGER)),
    st.integers(0, MAX_GRID_BITS),
    st.sampled_from(["f4", "f8"]),
)
def test_grids_of_any_size_are_lossless(integers, bits, dtype):
    values = values_of(integers.astype(np.int32), GRID + bits, np.dtype(dtype))
    back = decoded(encode_grid_table(integers, bits), integers.shape, np.dtype(dtype))
    assert (back.dtype, back.tobytes()) == (values.dtype, values.tobytes())


SHEET = grid_faces(30, 40)


def palette_of_rows(rng):
    return rng.integers(0, 1 << 20, (8, 2)).astype(np.int32)[rng.integers(0, 8, 1200)]


def smooth_rows(_rng):
    rows, columns = np.divmod(np.arange(1200), 40)
    return np.rint(900 * np.stack([np.sin(rows / 9), np.cos(columns / 5)], 1)).astype(np.int32)


def largest_integers(rng):
    return rng.choice(np.array([np.iinfo(np.int32).min, np.iinfo(np.int32).max]), (1200, 2))


@pytest.mark.parametrize(
    ("make", "predictors"),
    [(smooth_rows, {ON_SURFACE}), (palette_of_rows, {0, 1}), (largest_integers, {0, 1, 2})],
)
def test_integers_at_corners_are_lossless_with_the_best_predictor(make, predictors):
    values = make(np.random.default_rng(3)).astype(np.int32)
    data = encode_table(values, SHEET)
    assert data[1] in predictors
    np.testing.assert_array_equal(decoded(data, values.shape, INTEGER, SHEET), values)


@pytest.mark.parametrize("bits", [4, 10, 16])
def test_values_quantized_in_their_own_range_take_the_bytes_of_integers(bits):
    rows, columns = np.divmod(np.arange(1200), 40)
    low, step = np.array([0.37, -5.1], np.float32), np.float32(1.3) / np.float32(2**bits - 1)
    integers = np.stack([rows * (2**bits - 1) // 29, columns * (2**bits - 1) // 80], axis=1)
    values = low + integers.astype(np.float32) * step
    data = encode_table(values, SHEET)
    assert data[0] == OFFSET_GRID
    assert len(data) < len(encode_table(integers.astype(np.int32), SHEET)) + 16
    assert decoded(data, values.shape, SINGLE, SHEET).tobytes() == values.tobytes()


def test_values_beside_a_grid_are_not_put_on_it():
    values = np.random.default_rng(5).random((1200, 2)).astype(np.float32)
    assert encode_table(values, SHEET)[0] != OFFSET_GRID
