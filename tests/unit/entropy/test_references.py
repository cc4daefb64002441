import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel.entropy.coder import encode_integers
from meshreel.entropy.references import AGAIN, decode_references, encode_references
from meshreel.errors import CorruptStreamError, MeshReelError


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
    found = decode_references(encode_references(rows, places), places)
    np.testing.assert_array_equal(found, rows)


def test_size_is_small_when_rows_are_named_in_turn_and_again():
    places = np.tile(np.arange(5000), 6)
    assert len(encode_references(places, places)) < 1000


def test_size_is_small_when_few_places_have_two_rows():
    places = np.repeat(np.arange(5000), 6)
    rows = places.copy()
    rows[::600] = 5000 + np.arange(50)
    assert len(encode_references(rows, places)) < 1000


def test_decoding_raises_when_a_place_has_nothing_to_repeat():
    data = b"\x00" + encode_integers([np.array([AGAIN]), np.array([AGAIN]), np.array([], int)])
    with pytest.raises(CorruptStreamError, match="which has none"):
        decode_references(data, np.array([4, 4]))


def test_decoding_gives_our_error_or_rows_when_bytes_are_changed():
    rng = np.random.default_rng(1)
    places = rng.integers(0, 30, 200)
    data = encode_references(rng.integers(0, 40, 200), places)
    for _ in range(500):
        broken = bytearray(data)
        broken[rng.integers(len(data))] ^= rng.integers(1, 256)
        try:
            assert decode_references(bytes(broken), places).shape == (200,)
        except MeshReelError:
            continue


def test_decoding_says_so_when_more_references_have_numbers_than_there_are():
    rows, places = np.array([4, 4, 7]), np.array([0, 1, 0])
    data = encode_references(rows, places)
    assert data[0] == 3
    assert decode_references(data, places).tolist() == rows.tolist()
    with pytest.raises(CorruptStreamError, match="4 of 3 references have a number"):
        decode_references(b"\4" + data[1:], places)
