import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from meshreel.errors import CorruptStreamError
from meshreel.kernel.integers import MAX_MAGNITUDE, decode_rows, encode_rows

INTEGERS = st.one_of(
    st.integers(-3, 3), st.integers(-(1 << 16), 1 << 16), st.integers(-MAX_MAGNITUDE, MAX_MAGNITUDE)
)


@given(
    st.lists(st.tuples(st.lists(INTEGERS, max_size=40), st.integers(0, 3)), max_size=6),
)
def test_rows_come_back_when_decoded(rows_and_tables):
    rows = [np.array(row, np.int64) for row, _ in rows_and_tables]
    tables = [table for _, table in rows_and_tables]
    decoded = decode_rows(encode_rows(rows, tables), [len(row) for row in rows], tables)
    assert [row.tolist() for row in decoded] == [row.tolist() for row in rows]


@pytest.mark.parametrize("share", [0.5, 0.1, 0.01, 0.001])
def test_size_is_near_the_entropy_when_bits_are_rare(share):
    bits = (np.random.default_rng(7).random(200_000) < share).astype(int)
    entropy = -(share * np.log2(share) + (1 - share) * np.log2(1 - share)) * len(bits)
    entropy += share * len(bits) * 0.02  # signs and lengths that never differ
    assert 8 * len(encode_rows([bits], [0])) < 1.03 * entropy + 400


def test_carries_run_through_the_stream_when_numbers_lie_at_the_upper_end():
    # Unlikely zeros push the least number up to the edge; 4096 streams carry at many places.
    rng = np.random.default_rng(3)
    for _ in range(400):
        row = np.where(rng.random(60) < 0.05, rng.integers(-9, 9, 60), 1 << rng.integers(1, 30))
        assert decode_rows(encode_rows([row], [0]), [60], [0])[0].tolist() == row.tolist()


def test_error_is_raised_when_bytes_are_left_over():
    coded = encode_rows([np.arange(50)], [0])
    with pytest.raises(CorruptStreamError, match="integers are damaged"):
        decode_rows(coded + bytes(8) + b"\1", [50], [0])
