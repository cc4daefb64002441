import pytest

from meshreel.metrics.rate import (
    paper_anchors_bpvf,
    paper_coefficients_bpvf,
    paper_dictionary_bpvf_as_printed,
    paper_dictionary_bpvf_as_stored,
    rate_bpvf,
)


def test_rate_is_bits_per_vertex_and_frame_when_a_file_has_bytes():
    assert rate_bpvf(1000, 20, 50) == 8  # 8000 bits over 20 * 50


def test_paper_coefficients_rate_is_the_bits_each_when_all_take_the_same():
    # Eq. 13: q = bits n k / (n k).
    assert paper_coefficients_bpvf(6 * 9971 * 175, 9971, 175) == 6


def test_paper_anchors_rate_is_that_of_table_1_when_one_percent_are_anchors():
    # Eq. 13: q_a = 16 * 100 k / (10002 k) = 0.15997, printed 0.1600 for Handstand.
    assert paper_anchors_bpvf(100, 10002) == pytest.approx(0.1600, abs=5e-5)


@pytest.mark.parametrize(("n_verts", "printed"), [(9971, 0.2808), (10002, 0.2799)])
def test_paper_dictionary_rate_is_that_of_table_1_when_there_is_one_block(n_verts, printed):
    # Eq. 13 with n_b = 1, k_f = k = 175: 16 * 175 / n.
    assert paper_dictionary_bpvf_as_printed(1, 175, n_verts, 175) == pytest.approx(
        printed, abs=5e-5
    )


def test_paper_dictionary_rate_as_printed_does_not_change_when_blocks_are_cut():
    # Eq. 13 prints n_b^2 k_f^2 = k^2 for 7 blocks of 25 frames.
    whole = paper_dictionary_bpvf_as_printed(1, 175, 9971, 175)
    assert paper_dictionary_bpvf_as_printed(7, 25, 9971, 175) == pytest.approx(whole, rel=1e-15)


def test_paper_dictionary_rate_as_stored_falls_with_the_blocks_when_they_are_cut():
    # 7 dictionaries of 25 x 25 hold a seventh of one of 175 x 175.
    whole = paper_dictionary_bpvf_as_stored(1, 175, 9971, 175)
    found = paper_dictionary_bpvf_as_stored(7, 25, 9971, 175)
    assert found == pytest.approx(whole / 7, rel=1e-15)


def test_paper_dictionary_rates_agree_when_there_is_one_block():
    arguments = (1, 175, 10002, 175)
    assert paper_dictionary_bpvf_as_stored(*arguments) == paper_dictionary_bpvf_as_printed(
        *arguments
    )
