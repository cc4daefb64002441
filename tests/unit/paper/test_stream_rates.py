"""Rates in the count of Table I (Eq. 13) and as stored."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.paper.decoder import coded_blocks
from meshreel.paper.stream_rates import rates
from samples.meshes import waving_grid

N, K = 99, 12  # vertices and frames of the grid


def encoded(method, **options):
    return meshreel.encode(waving_grid(), method, **options)


def stored_bits(data, *sections):
    """Bits of a coordinate matrix in these sections."""
    budget = meshreel.info(data).budget_bytes
    return 8 * sum(budget.get(section, 0) for section in sections) / 3


def test_q_counts_bits_of_the_largest_integer_of_each_row():
    # Eq. 13: q = bits n k / (n k), with a sign and the bits of the magnitude for each entry.
    data = encoded("v2v", n_modes=3, bits=8)
    (block,) = coded_blocks(data)
    bits = [
        [len(f"{max(abs(int(one)) for one in row):b}") + 1 if row.any() else 0 for row in axis]
        for axis in block.coefficients.integers
    ]
    result = rates(data).eq13
    np.testing.assert_array_equal(result.bits_per_row[0], bits)
    assert result.q == pytest.approx(np.sum(bits) / 3 / K)
    assert result.bits_per_row[0].max() == 8


@pytest.mark.parametrize("anchor_bits", [2, 3, 12, 16])
def test_q_a_counts_the_bits_of_the_anchors_positions(anchor_bits):
    # Eq. 13: q_a = bits n_c k / (n k); ceil(0.05 * 99) = 5 anchors.
    data = encoded("pca-qp", n_modes=3, anchors=0.05, choices={"anchor_bits": anchor_bits})
    assert rates(data).eq13.q_a == pytest.approx(anchor_bits * 5 / N)


def test_q_a_counts_coefficients_when_positions_are_not_stored():
    choices = {"anchor_values": "coefficients"}
    data = encoded("pca-qp", n_modes=3, anchors=0.05, choices=choices)
    assert rates(data).eq13.q_a == pytest.approx(16 * 5 * 3 / (N * K))


@pytest.mark.parametrize("bits", [8, 16])
def test_q_d_counts_the_bits_of_the_dictionary(bits):
    # Eq. 13 with one block: bits k^2 / (n k).
    result = rates(encoded("pca-qp", n_modes=3, choices={"dictionary_bits": bits}))
    assert result.dictionary_bits == bits
    assert result.eq13.q_d == result.q_d_per_block == pytest.approx(bits * K / N)


def test_q_d_counts_a_short_last_block_by_its_own_frames():
    # 12 frames in blocks of 5, 5 and 2.
    data = encoded("blocks", n_modes=2, block_frames=5)
    result = rates(data)
    bits = result.stored.q_d * N * K / (2 * K)  # of a stored entry: 2 modes of 12 frames
    assert result.dictionary_bits == pytest.approx(bits)
    assert result.eq13.q_d == pytest.approx(bits * K**2 / (N * K))  # n_b^2 k_f^2, as printed
    assert result.q_d_per_block == pytest.approx(bits * (25 + 25 + 4) / (N * K))


def test_stored_rates_are_a_third_of_the_sections():
    data = encoded("pca-qp", n_modes=3, anchors=0.05)
    result = rates(data).stored
    for rate, sections in (
        (result.q, ["coefficients"]),
        (result.q_a, ["anchors", "anchor residuals"]),
        (result.q_d, ["basis"]),
    ):
        headers = stored_bits(data, *sections) - rate * N * K
        assert 0 < headers * 3 / 8 <= 9 * len(sections)
    assert result.q_s == pytest.approx(result.q + result.q_a + result.q_d)


@pytest.mark.parametrize("method", ["pca", "pca-q", "v2v"])
def test_variants_without_anchors_have_no_q_a(method):
    result = rates(encoded(method, n_modes=3))
    for count in (result.eq13, result.stored):
        assert count.q_a is None
        assert count.q_s == pytest.approx(count.q + count.q_d)


def test_gft_has_no_dictionary_and_a_coefficient_per_frame_in_each_row():
    data = encoded("gft", n_modes=10, anchors=0.05)
    result = rates(data)
    assert result.eq13.q_d is result.stored.q_d is result.dictionary_bits is None
    (rows,) = result.stored.bits_per_row
    assert rows.shape == (3, 10)
    assert result.eq13.q == pytest.approx(result.eq13.bits_per_row[0].sum() * K / 3 / (N * K))


def test_stored_bits_per_row_sum_to_the_section():
    sequence = waving_grid(12, 40, 40)
    data = meshreel.encode(sequence, "pca-qp", n_modes=5)
    (rows,) = rates(data).stored.bits_per_row
    assert rows.shape == (3, 5)
    section = 8 * meshreel.info(data).budget_bytes["coefficients"]
    assert rows.sum() * sequence.n_verts == pytest.approx(section, rel=0.15)


def test_entropy_is_that_of_each_row():
    data = encoded("v2v", n_modes=3)
    (block,) = coded_blocks(data)
    bits = 0.0
    for row in block.coefficients.integers.reshape(9, N):
        shares = np.unique(row, return_counts=True)[1] / N
        bits -= N * float(shares @ np.log2(shares))
    assert rates(data).q_entropy == pytest.approx(bits / 3 / (N * K))


def test_rates_of_a_file_are_those_of_its_bytes(tmp_path):
    data = encoded("blocks", n_modes=2, block_frames=4)
    (tmp_path / "walk.reel").write_bytes(data)
    assert rates(tmp_path / "walk.reel").eq13.q_s == meshreel.paper.rates(data).eq13.q_s


def test_streams_of_other_methods_are_refused():
    with pytest.raises(InvalidInputError, match="not one of the paper's"):
        rates(encoded("reel"))
