import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from conformance.surface import read_references
from meshreel.codec.surface.references import encode_references


@given(
    st.integers(0, 80).flatmap(
        lambda size: st.tuples(
            arrays(np.int32, size, elements=st.integers(0, 20)),
            arrays(np.int32, size, elements=st.integers(0, 9)),
        )
    )
)
def test_references_come_back_when_coded(case):
    rows, places = case
    assert read_references(encode_references(rows, places), places.tolist()) == rows.tolist()


def test_size_is_small_when_rows_are_named_in_turn_and_again():
    places = np.tile(np.arange(5000), 6)
    assert len(encode_references(places, places)) < 1000


def test_size_is_small_when_few_places_have_two_rows():
    places = np.repeat(np.arange(5000), 6)
    rows = places.copy()
    rows[::600] = 5000 + np.arange(50)
    assert len(encode_references(rows, places)) < 1000
