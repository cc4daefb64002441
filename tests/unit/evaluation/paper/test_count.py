"""The paper's count of small streams, by hand."""

import numpy as np
import pytest

import meshreel
from meshreel.evaluation.paper.count import paper_count
from meshreel.evaluation.paper.settings import Setting
from meshreel.paper.decoder import coded_blocks
from samples.meshes import waving_grid

N, K = 99, 12  # vertices and frames of the grid


def counted(setting):
    data = meshreel.encode(waving_grid(), **setting.options())
    stream = meshreel.info(data)
    return paper_count(setting, stream, coded_blocks(data)), stream


def test_count_is_that_of_eq_13_when_there_is_one_dictionary():
    count, stream = counted(Setting("pca-qp", 3, anchors=0.05))
    assert count["q"] == pytest.approx(8 * stream.budget_bytes["coefficients"] / 3 / (N * K))
    assert count["q_a"] == pytest.approx(16 * 5 / N)  # ceil(0.05 * 99) = 5 anchors
    assert count["q_d"] == count["q_d_as_stored"] == pytest.approx(16 * K / N)
    assert count["q_s"] == pytest.approx(count["q"] + count["q_a"] + count["q_d"])


@pytest.mark.parametrize("method", ["pca-q", "v2v"])
def test_count_has_no_anchors_when_the_method_decodes_without(method):
    count, _ = counted(Setting(method, 3))
    assert count["q_a"] is None
    assert count["q_s"] == pytest.approx(count["q"] + count["q_d"])


def test_count_takes_the_bits_that_dictionaries_take_when_there_are_blocks():
    count, stream = counted(Setting("blocks", 3, anchors=0.05, block_frames=4))
    bits = 8 * stream.budget_bytes["basis"] / (3 * 3 * K)  # 3 axes, 3 modes, 12 frames in all
    assert count["dictionary_bits"] == pytest.approx(bits)
    assert count["q_d"] == pytest.approx(bits * 3**2 * 4**2 / (N * K))  # as printed: n_b^2
    assert count["q_d_as_stored"] == pytest.approx(bits * 3 * 4**2 / (N * K))


def test_count_has_no_dictionary_when_it_follows_from_connectivity():
    count, _ = counted(Setting("gft", 10, anchors=0.05))
    assert count["q_d"] is None
    assert count["q_s"] == pytest.approx(count["q"] + 16 * 5 / N)


def test_q_is_a_third_of_the_coefficients_when_all_axes_are_coded():
    count, stream = counted(Setting("v2v", 3))
    bits = 8 * stream.budget_bytes["coefficients"]
    assert np.isclose(3 * count["q"] * N * K, bits)
