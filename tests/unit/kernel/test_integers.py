import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.integers import MAX_MAGNITUDE, decode_integers, encode_integers

INTEGERS = st.one_of(
    st.integers(-3, 3), st.integers(-(1 << 16), 1 << 16), st.integers(-MAX_MAGNITUDE, MAX_MAGNITUDE)
)


@given(st.lists(st.tuples(st.lists(INTEGERS, max_size=40), st.integers(0, 3)), max_size=6))
def test_rows_round_trip(rows_and_tables):
    rows = [np.array(row, np.int64) for row, _ in rows_and_tables]
    tables = [table for _, table in rows_and_tables]
    decoded = decode_integers(encode_integers(rows, tables), [len(row) for row in rows], tables)
    assert [row.tolist() for row in decoded] == [row.tolist() for row in rows]


@given(st.binary(max_size=200), st.lists(st.integers(0, 500), max_size=4))
def test_random_bytes_decode_to_rows_or_our_error(data, lengths):
    try:
        decoded = decode_integers(data, lengths)
    except CorruptStreamError:
        return
    assert [len(row) for row in decoded] == lengths


@pytest.mark.parametrize("share", [0.5, 0.1, 0.01, 0.001])
def test_rare_bits_take_about_their_entropy(share):
    bits = (np.random.default_rng(7).random(200_000) < share).astype(int)
    entropy = -(share * np.log2(share) + (1 - share) * np.log2(1 - share)) * len(bits)
    entropy += share * len(bits) * 0.02  # constant signs and lengths
    assert 8 * len(encode_integers([bits], [0])) < 1.03 * entropy + 400


def test_carries_propagate_through_the_stream():
    # Unlikely zeros push the lower end of the interval up; 4096 streams carry at many places.
    rng = np.random.default_rng(3)
    for _ in range(400):
        row = np.where(rng.random(60) < 0.05, rng.integers(-9, 9, 60), 1 << rng.integers(1, 30))
        assert decode_integers(encode_integers([row], [0]), [60], [0])[0].tolist() == row.tolist()


def laplacian_rows():
    rng = np.random.default_rng(11)
    return [np.rint(rng.laplace(scale=scale, size=4000)).astype(int) for scale in (0.3, 3, 30, 300)]


def entropy_bits(row):
    _, counts = np.unique(row, return_counts=True)
    return -np.sum(counts * np.log2(counts / counts.sum()))


def test_laplacian_rows_take_about_their_entropy():
    rows = laplacian_rows()[:3]
    assert 8 * len(encode_integers(rows)) < 1.02 * sum(map(entropy_bits, rows)) + 1000


def test_zeros_take_few_bytes():
    zeros = np.zeros(10**6, int)
    data = encode_integers([zeros])
    assert len(data) < 300
    assert not decode_integers(data, [len(zeros)])[0].any()


@pytest.mark.every_case
@pytest.mark.parametrize("more", [b"\0", b"\0" * 9, b"\1" * 9, bytes(8) + b"\1"])
def test_decoding_raises_for_trailing_bytes(more):
    with pytest.raises(CorruptStreamError):
        decode_integers(encode_integers(laplacian_rows()) + more, [4000] * 4)


def test_short_row_takes_few_bytes():
    """For typical short rows, adaptation must not take more bytes than the contents."""
    rng = np.random.default_rng(5)
    row = np.rint(rng.laplace(scale=20, size=40)).astype(int)
    assert 8 * len(encode_integers([row])) < 40 * 6.8 + 80


def test_clustered_magnitudes_take_fewer_bytes():
    rng = np.random.default_rng(6)
    scales = np.repeat([1, 100] * 10, 200)
    row = np.rint(rng.laplace(scale=scales)).astype(int)
    shuffled = rng.permutation(row)
    assert len(encode_integers([row])) < 0.92 * len(encode_integers([shuffled]))


def test_stored_bytes_are_decoded():
    """Decoding of stored streams depends on every rule of the models."""
    stored = bytes.fromhex("91300d632ca0152b265cf9e8f5d401")
    first, second = decode_integers(stored, [30, 3])
    assert first.tolist() == [0, 1, -1, 0, 2, 0, 0, 40, -3, 0] * 3
    assert second.tolist() == [1000, -1000, 5]


@pytest.mark.parametrize("sign", [1, -1])
def test_integers_are_coded_up_to_the_largest_and_no_larger(sign):
    largest = np.array([0, sign * MAX_MAGNITUDE])
    (decoded,) = decode_integers(encode_integers([largest]), [2])
    assert decoded.tolist() == largest.tolist()
    with pytest.raises(InvalidInputError, match=f"up to {MAX_MAGNITUDE} can be coded"):
        encode_integers([largest + sign])


def test_empty_rows_take_no_bytes():
    assert encode_integers([]) == b""
    assert decode_integers(b"", []) == []
