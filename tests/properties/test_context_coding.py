import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.entropy.field_coder import decode_fields, encode_fields
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.errors import CorruptStreamError

integers = st.one_of(
    st.just(0),
    st.integers(-3, 3),
    st.integers(-300, 300),
    st.integers(-MAX_MAGNITUDE, MAX_MAGNITUDE),
)


@st.composite
def fields_and_neighbours(draw):
    n_rows, n_columns = draw(st.integers(0, 6)), draw(st.integers(0, 12))
    values = draw(st.lists(integers, min_size=n_rows * n_columns, max_size=n_rows * n_columns))
    return np.array(values, np.int64).reshape(n_rows, n_columns), draw(neighbours_of(n_columns))


def neighbours_of(n_columns):
    """Any lists at all: a graph need be neither symmetric nor free of loops and repetitions."""
    column = st.integers(0, max(n_columns - 1, 0))
    lists = st.lists(st.lists(column, max_size=4), min_size=n_columns, max_size=n_columns)
    return st.one_of(st.none(), lists.map(as_arrays))


def as_arrays(lists):
    indptr = np.cumsum([0] + [len(one) for one in lists])
    return indptr, np.array([index for one in lists for index in one], np.int64)


@settings(max_examples=300, deadline=None)
@given(fields_and_neighbours())
def test_fields_come_back_exactly_whatever_they_hold(case):
    fields, neighbours = case
    data = encode_fields(fields, neighbours)
    np.testing.assert_array_equal(decode_fields(data, *fields.shape, neighbours), fields)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200), st.integers(0, 8), st.data())
def test_any_bytes_give_fields_or_our_error(data, n_rows, drawn):
    n_columns = drawn.draw(st.integers(0, 40))
    neighbours = drawn.draw(neighbours_of(n_columns))
    try:
        decoded = decode_fields(data, n_rows, n_columns, neighbours)
    except CorruptStreamError:
        return
    assert decoded.shape == (n_rows, n_columns)


@settings(max_examples=200, deadline=None)
@given(fields_and_neighbours(), st.data())
def test_a_flipped_bit_gives_fields_or_our_error(case, drawn):
    fields, neighbours = case
    data = bytearray(encode_fields(fields, neighbours))
    data[drawn.draw(st.integers(0, len(data) - 1))] ^= 1 << drawn.draw(st.integers(0, 7))
    try:
        decoded = decode_fields(bytes(data), *fields.shape, neighbours)
    except CorruptStreamError:
        return
    assert decoded.shape == fields.shape
