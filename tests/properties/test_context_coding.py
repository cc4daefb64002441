from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.errors import CorruptStreamError
from meshreel.kernel.fields import MAX_MAGNITUDE, encode_fields
from samples.coded_fields import decode_fields
from samples.costs import draws
from samples.passes import as_order

integers = st.one_of(
    st.just(0),
    st.integers(-3, 3),
    st.integers(-300, 300),
    st.integers(-MAX_MAGNITUDE, MAX_MAGNITUDE),
)


@st.composite
def fields_and_passes(draw):
    n_rows, n_columns = draw(st.integers(0, 15)), draw(st.integers(0, 12))
    values = draw(st.lists(integers, min_size=n_rows * n_columns, max_size=n_rows * n_columns))
    return np.array(values, np.int64).reshape(n_rows, n_columns), draw(passes_of(n_columns))


@st.composite
def passes_of(draw, n_columns):
    """Every column once, in any passes; neighbors are any earlier columns, also repeated."""
    if draw(st.booleans()):
        return None
    order = draw(st.permutations(range(n_columns)))
    cuts = sorted(draw(st.lists(st.integers(0, n_columns), max_size=4)))
    passes = []
    for start, end in pairwise([0, *cuts, n_columns]):
        near = [
            draw(st.lists(st.sampled_from(order[:i]), max_size=4)) if i else []
            for i in range(start, end)
        ]
        passes.append((order[start:end], near))
    return as_order(*passes)


@settings(max_examples=draws(300))
@given(fields_and_passes())
def test_any_fields_round_trip(case):
    fields, passes = case
    data = encode_fields(fields, passes)
    np.testing.assert_array_equal(decode_fields(data, *fields.shape, passes=passes), fields)


@settings(max_examples=draws(300))
@given(st.binary(max_size=200), st.integers(0, 16), st.data())
def test_random_bytes_decode_to_fields_or_our_error(data, n_rows, drawn):
    n_columns = drawn.draw(st.integers(0, 40))
    passes = drawn.draw(passes_of(n_columns))
    try:
        decoded = decode_fields(data, n_rows, n_columns, passes)
    except CorruptStreamError:
        return
    assert decoded.shape == (n_rows, n_columns)


@settings(max_examples=draws(200))
@given(fields_and_passes(), st.data())
def test_a_flipped_bit_decodes_to_fields_or_our_error(case, drawn):
    fields, passes = case
    data = bytearray(encode_fields(fields, passes))
    data += bytes(not data)  # at least one byte to flip
    data[drawn.draw(st.integers(0, len(data) - 1))] ^= 1 << drawn.draw(st.integers(0, 7))
    try:
        decoded = decode_fields(bytes(data), *fields.shape, passes=passes)
    except CorruptStreamError:
        return
    assert decoded.shape == fields.shape
