import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel.entropy.tables import decode_table, encode_table
from meshreel.errors import CorruptStreamError, MeshReelError

SHAPES = st.tuples(st.integers(0, 12), st.integers(1, 4))


def assert_comes_back(values):
    back = decode_table(encode_table(values), values.shape, values.dtype)
    assert back.dtype == values.dtype
    assert back.tobytes() == values.tobytes()


@pytest.mark.parametrize("dtype", ["u1", "i4", "f4", "f8"])
def test_table_comes_back_bit_by_bit_when_of_any_type(dtype):
    @given(arrays(dtype, SHAPES))
    def check(values):
        assert_comes_back(values)

    check()


@given(arrays(np.int64, SHAPES, elements=st.integers(-(10**8), 10**8)), st.integers(0, 9))
def test_decimals_come_back_when_rounded_to_single_precision(integers, places):
    assert_comes_back((integers / 10.0**places).astype(np.float32))


def test_signs_of_zero_come_back_when_all_else_is_decimal():
    assert_comes_back(np.array([[0.5], [-0.0], [0.0]], np.float32))


def test_decimals_take_fewer_bytes_when_they_have_few_places():
    values = (np.random.default_rng(0).integers(0, 10**4, (5000, 2)) / 1e4).astype(np.float32)
    assert len(encode_table(values)) < 0.5 * values.nbytes


def test_decoding_is_refused_when_more_is_announced_than_bytes_can_hold():
    data = encode_table(np.random.default_rng(0).random((4, 2)))
    with pytest.raises(CorruptStreamError, match="cannot hold it"):
        decode_table(data, (1 << 40, 2), np.dtype(np.float64))


def test_decoding_gives_our_error_or_a_table_when_bytes_are_changed():
    rng = np.random.default_rng(1)
    for values in (rng.random((30, 2)), np.round(rng.random((30, 2)), 3)):
        data = encode_table(values)
        for _ in range(300):
            broken = bytearray(data)
            broken[rng.integers(len(data))] ^= rng.integers(1, 256)
            try:
                assert decode_table(bytes(broken), values.shape, values.dtype).shape == (30, 2)
            except MeshReelError:
                continue
