import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.errors import MeshReelError
from meshreel.kernel.integers import MAX_MAGNITUDE, decode_integers, encode_integers
from samples.costs import draws

integers = st.one_of(
    st.integers(-3, 3), st.integers(-300, 300), st.integers(-MAX_MAGNITUDE, MAX_MAGNITUDE)
)
rows = st.lists(st.lists(integers, max_size=60), max_size=6)


@settings(max_examples=draws(200))
@given(rows, st.data())
def test_any_rows_round_trip(values, data):
    tables = data.draw(st.lists(st.integers(0, 3), min_size=len(values), max_size=len(values)))
    arrays = [np.array(row, np.int64) for row in values]
    decoded = decode_integers(encode_integers(arrays, tables), [len(row) for row in values], tables)
    assert [row.tolist() for row in decoded] == values


@settings(max_examples=draws(300))
@given(st.binary(max_size=200), st.lists(st.integers(0, 500), max_size=4))
def test_random_bytes_decode_to_rows_or_our_error(data, lengths):
    try:
        decoded = decode_integers(data, lengths)
    except MeshReelError:
        return
    assert [len(row) for row in decoded] == lengths
