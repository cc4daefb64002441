import numpy as np
import pytest

from meshreel.reel.encoding.rate_distortion import FAIR_PRICE, quantize_by_rate


def columns_of_many_scales(n_rows=4000):
    return np.random.default_rng(4).laplace(scale=[0.05, 0.2, 0.5, 1.0, 30.0], size=(n_rows, 5))


def cost(scaled, integers, price):
    """Squared error plus the price of the entropy of each column's magnitudes and signs."""
    total = ((scaled - integers) ** 2).sum()
    for column in integers.T:
        counts = np.unique(np.abs(column), return_counts=True)[1]
        shares = counts / len(column)
        bits = -(counts * np.log2(shares)).sum() + np.count_nonzero(column)
        total += price * bits
    return total


@pytest.mark.parametrize("price", [FAIR_PRICE / 2, FAIR_PRICE, 2 * FAIR_PRICE])
def test_error_and_bits_together_cost_less_than_by_plain_rounding_when_zeros_are_common(price):
    scaled = columns_of_many_scales()[:, 1:4]
    for column in scaled.T[:, :, None]:
        by_rate = quantize_by_rate(column, price)
        assert cost(column, by_rate, price) < cost(column, np.rint(column), price)


def test_integers_are_the_nearest_when_bits_are_free():
    scaled = columns_of_many_scales()
    np.testing.assert_array_equal(quantize_by_rate(scaled, 0.0), np.rint(scaled))


def test_error_stays_below_a_step_when_values_become_zero_and_near_half_a_step_otherwise():
    scaled = columns_of_many_scales()
    integers = quantize_by_rate(scaled, FAIR_PRICE)
    error = np.abs(scaled - integers)
    assert error.max() <= 1.0
    assert error[integers != 0].max() <= 0.55


def test_signs_are_those_of_the_values_when_they_do_not_vanish():
    scaled = columns_of_many_scales()
    integers = quantize_by_rate(scaled, FAIR_PRICE)
    used = integers != 0
    np.testing.assert_array_equal(np.sign(integers)[used], np.sign(scaled)[used])
    np.testing.assert_array_equal(quantize_by_rate(-scaled, FAIR_PRICE), -integers)


def test_larger_magnitudes_never_become_smaller_integers_when_a_column_is_sorted():
    scaled = np.sort(np.abs(columns_of_many_scales()), axis=0)
    assert (np.diff(quantize_by_rate(scaled, FAIR_PRICE), axis=0) >= 0).all()


def test_zeros_grow_more_when_bits_cost_more():
    scaled = columns_of_many_scales()
    prices = (0.0, 0.5 * FAIR_PRICE, FAIR_PRICE, 2 * FAIR_PRICE)
    zeros = np.array([(quantize_by_rate(scaled, price) == 0).sum(axis=0) for price in prices])
    assert (np.diff(zeros, axis=0) >= 0).all()
    assert (np.diff(zeros[:, 2]) > 0).all()


def test_rare_values_are_dropped_sooner_when_nearly_all_others_vanish():
    """The same value, among zeros and among many of its kind."""
    rare, common = np.zeros((1000, 1)), np.full((1000, 1), 0.7)
    rare[7] = 0.7
    assert quantize_by_rate(rare, FAIR_PRICE)[7, 0] == 0
    assert quantize_by_rate(common, FAIR_PRICE)[7, 0] == 1


def test_columns_are_rounded_by_their_own_statistics_when_there_are_several():
    scaled = columns_of_many_scales()
    alone = [quantize_by_rate(column[:, None], FAIR_PRICE)[:, 0] for column in scaled.T]
    np.testing.assert_array_equal(quantize_by_rate(scaled, FAIR_PRICE), np.stack(alone, axis=1))


def test_integers_are_integers_when_there_are_none():
    for shape in ((0, 3), (4, 0)):
        integers = quantize_by_rate(np.zeros(shape), FAIR_PRICE)
        assert (integers.shape, integers.dtype) == (shape, np.dtype(np.int64))


def test_values_given_stay_as_they_are_when_rounded():
    scaled = columns_of_many_scales(50)
    before = scaled.copy()
    quantize_by_rate(scaled, FAIR_PRICE)
    np.testing.assert_array_equal(scaled, before)
