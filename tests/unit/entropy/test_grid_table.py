import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from meshreel.entropy.grid_table import LARGEST, MAX_GRID_BITS, grid_values
from meshreel.entropy.tables import decode_table, encode_grid_table, encode_table
from meshreel.errors import CorruptStreamError, MeshReelError, TruncatedStreamError

SHAPES = st.tuples(st.integers(0, 12), st.integers(1, 4))
SINGLE = np.dtype(np.float32)


@given(
    arrays(np.int64, SHAPES, elements=st.integers(-LARGEST, LARGEST)),
    st.integers(0, MAX_GRID_BITS),
    st.sampled_from(["f4", "f8"]),
)
def test_grid_comes_back_bit_by_bit_when_of_any_size(integers, bits, dtype):
    values = grid_values(integers, bits, np.dtype(dtype))
    back = decode_table(encode_grid_table(integers, bits), integers.shape, np.dtype(dtype))
    assert (back.dtype, back.tobytes()) == (values.dtype, values.tobytes())


def test_grid_takes_fewer_bytes_than_patterns_when_values_follow_one_another():
    integers = np.cumsum(np.random.default_rng(0).integers(-9, 10, (3000, 2)), axis=0)
    patterns = encode_table(grid_values(integers, 12, SINGLE))
    assert len(encode_grid_table(integers, 12)) < 0.6 * len(patterns)


def test_grid_is_not_differenced_when_values_do_not_follow_one_another():
    integers = np.random.default_rng(0).integers(0, 4, (3000, 1))
    assert encode_grid_table(integers, 2)[2] == 0


@pytest.mark.parametrize("head", [b"\xfe\x19\x00", b"\xfe\x08\x02"])
def test_grid_is_refused_when_its_head_is_unknown(head):
    coded = head + encode_grid_table(np.arange(4).reshape(4, 1), 8)[3:]
    with pytest.raises(CorruptStreamError, match="on a grid of"):
        decode_table(coded, (4, 1), SINGLE)


def test_grid_is_refused_when_its_numbers_are_whole():
    coded = encode_grid_table(np.arange(4).reshape(4, 1), 8)
    with pytest.raises(CorruptStreamError, match="a table of int32 is on a grid"):
        decode_table(coded, (4, 1), np.dtype(np.int32))


def test_decoding_raises_when_a_grid_ends_in_its_head():
    with pytest.raises(TruncatedStreamError):
        decode_table(b"\xfe\x08", (4, 1), SINGLE)


def test_decoding_a_grid_gives_our_error_or_a_table_when_bytes_are_changed():
    rng = np.random.default_rng(1)
    data = encode_grid_table(rng.integers(-999, 999, (30, 2)), 10)
    for _ in range(500):
        broken = bytearray(data)
        broken[rng.integers(len(data))] ^= rng.integers(1, 256)
        try:
            assert decode_table(bytes(broken), (30, 2), SINGLE).shape == (30, 2)
        except MeshReelError:
            continue
