import numpy as np
import pytest

from meshreel.evaluation.envelopes import compare_at_equal_rate, lower_envelope


def test_envelope_keeps_what_no_other_point_beats():
    points = [(3.0, 1.0), (1.0, 4.0), (2.0, 5.0), (2.0, 2.0), (4.0, 1.0)]
    assert lower_envelope(points) == [(1.0, 4.0), (2.0, 2.0), (3.0, 1.0)]


def test_envelope_leaves_out_what_a_log_axis_cannot_show():
    assert lower_envelope([(0.0, 1.0), (1.0, 0.0), (1.0, 2.0)]) == [(1.0, 2.0)]


def power_law(rates, factor):
    return [(rate, factor * rate**-1.5) for rate in rates]


def test_error_ratio_is_the_factor_between_power_laws_when_rates_overlap():
    first = power_law(np.geomspace(0.5, 4, 6), 3.0)
    second = power_law(np.geomspace(1, 8, 7), 2.0)
    overlap = compare_at_equal_rate(first, second)
    assert overlap.error_ratio == pytest.approx(1.5, rel=1e-2)
    assert (overlap.low_bpvf, overlap.high_bpvf) == pytest.approx((1, 4))


def test_nothing_is_compared_when_rates_do_not_overlap():
    assert compare_at_equal_rate(power_law([1, 2], 1), power_law([3, 4], 1)) is None


@pytest.mark.parametrize("points", [[], [(1.0, 1.0)], [(1.0, 1.0), (2.0, 3.0)]])
def test_nothing_is_compared_when_an_envelope_is_no_line(points):
    assert compare_at_equal_rate(points, power_law([0.5, 3], 1)) is None
