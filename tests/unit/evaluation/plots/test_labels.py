import numpy as np
import pytest

from meshreel.evaluation.plots.labels import spread


def test_spread_keeps_heights_that_do_not_overlap():
    assert spread([0.8, 0.1, 0.5], [0.1, 0.1, 0.1]) == pytest.approx([0.8, 0.1, 0.5])


def test_equal_heights_are_spread_around_their_mean():
    assert sorted(spread([0.5, 0.5, 0.5], [0.1] * 3)) == pytest.approx([0.4, 0.5, 0.6])


def test_labels_near_an_end_stay_inside():
    assert sorted(spread([0.0, 0.02, 0.01], [0.1] * 3)) == pytest.approx([0.05, 0.15, 0.25])
    assert sorted(spread([1.0, 0.98], [0.1] * 2)) == pytest.approx([0.85, 0.95])


def test_labels_of_different_heights_do_not_overlap():
    rng = np.random.default_rng(3)
    heights, needed = rng.uniform(0, 1, 12), rng.uniform(0.02, 0.12, 12)
    placed = np.array(spread(list(heights), list(needed)))
    order = np.argsort(placed)
    gaps = np.diff(placed[order])
    assert (gaps >= (needed[order][1:] + needed[order][:-1]) / 2 - 1e-12).all()
    assert (order == np.argsort(heights)).all()


def test_spread_of_no_labels_is_empty():
    assert spread([], []) == []
