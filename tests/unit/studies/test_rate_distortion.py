from dataclasses import astuple

import numpy as np
import pytest

from meshreel.studies.rate_distortion import (
    bd_rate,
    error_at_equal_rate,
    lower_envelope,
    rate_at_error,
)

RATES = np.geomspace(0.1, 10, 9)


def curve(scale=1.0, power=1.3, rates=RATES):
    """Points of ``error = (rate / scale) ** -power``."""
    return [(float(rate), float((rate / scale) ** -power)) for rate in rates]


@pytest.mark.parametrize(("scale", "percent"), [(0.5, -50), (1, 0), (2, 100), (0.1, -90)])
def test_bd_rate_of_scaled_rates_is_their_ratio(scale, percent):
    scaled = [(scale * rate, error) for rate, error in curve()]
    result = bd_rate(scaled, curve())
    assert result.percent == pytest.approx(percent, abs=1e-9)
    errors = [error for _, error in curve()]
    assert (result.low_error, result.high_error) == pytest.approx((min(errors), max(errors)))
    assert result.reason == ""


def test_bd_rate_does_not_depend_on_the_sampling_of_curves():
    result = bd_rate(curve(0.5, rates=np.geomspace(0.3, 3, 13)), curve())
    assert result.percent == pytest.approx(-50, abs=1e-6)


def test_bd_rate_is_the_mean_of_the_log_ratio():
    steep, flat = curve(power=2), curve(power=1)
    # Log rates are -e / 2 and -e over the log errors e of the overlap, which is symmetric.
    result = bd_rate(steep[4:], flat[4:])  # errors 1 to 0.1 are common
    expected = 100 * np.expm1(-np.log(10) / 2 * 0.5)
    assert result.percent == pytest.approx(expected, abs=1e-6)
    assert (result.low_error, result.high_error) == pytest.approx((0.1, 1))


def test_bd_rate_ignores_dominated_points():
    poor = [(3 * rate, 1.5 * error) for rate, error in curve()]
    assert bd_rate(curve(0.5) + poor, curve()) == bd_rate(curve(0.5), curve())


def test_bd_rate_ignores_lossless_points():
    assert bd_rate([*curve(0.5), (50.0, 0.0)], curve()) == bd_rate(curve(0.5), curve())


def test_bd_rate_states_that_no_errors_are_common():
    result = bd_rate(curve(rates=[0.1, 0.2]), curve(rates=[1, 2]))
    assert astuple(result) == (None, 0, 0, "no common errors")


@pytest.mark.parametrize("points", [[], curve()[:1], [(1.0, 0.5), (2.0, 0.5)]])
def test_bd_rate_states_that_points_are_missing(points):
    for result in (bd_rate(points, curve()), bd_rate(curve(), points)):
        assert astuple(result) == (None, 0, 0, "fewer than 2 points")


def test_rate_at_error_interpolates_the_curve():
    assert rate_at_error(curve(0.7), 0.3) == pytest.approx(0.7 * 0.3 ** (-1 / 1.3), rel=1e-9)


@pytest.mark.parametrize("error", [1e-9, 1e9])
def test_rate_at_error_is_none_outside_the_curve(error):
    assert rate_at_error(curve(), error) is None


def test_envelope_contains_the_pareto_optimal_points():
    points = [(3.0, 1.0), (1.0, 4.0), (2.0, 5.0), (2.0, 2.0), (4.0, 1.0)]
    assert lower_envelope(points) == [(1.0, 4.0), (2.0, 2.0), (3.0, 1.0)]


def test_envelope_omits_zeros():
    assert lower_envelope([(0.0, 1.0), (1.0, 0.0), (1.0, 2.0)]) == [(1.0, 2.0)]


def test_error_at_equal_rate_of_power_laws_is_the_ratio_of_their_factors():
    triple = [(rate, 3 * rate**-1.5) for rate in np.geomspace(0.5, 4, 6)]
    double = [(rate, 2 * rate**-1.5) for rate in np.geomspace(1, 8, 7)]
    result = error_at_equal_rate(triple, double)
    assert result.percent == pytest.approx(50, abs=1e-6)
    assert (result.low_error, result.high_error) == pytest.approx((1, 4))
    assert error_at_equal_rate(triple[:2], double[-2:]).percent is None
