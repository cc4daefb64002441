"""Conversion between units of physical quantities."""

import pytest

from meshreel.codec.units import unit_ratio


@pytest.mark.parametrize(
    ("unit", "other", "ratio"),
    [
        ("mm", "m", 1e-3),
        ("in", "mm", 25.4),
        ("ft", "in", 12),
        ("MPa", "Pa", 1e6),
        ("N/mm^2", "MPa", 1),
        ("psi", "kPa", 6.894757293168361),
        ("km/h", "m/s", 1 / 3.6),
        ("kg*m^2", "g.cm^2", 1e7),
        ("m*s^-2", "mm/s^2", 1e3),
        ("J/kg/K", "m^2/s^2/K", 1),
        ("kW", "J/s", 1e3),
        ("degC", "K", 1),
        ("deg", "rad", 0.017453292519943295),
        ("min", "ms", 60_000),
        ("m3/s", "m^3/s", 1),
    ],
)
def test_units_of_one_quantity_convert(unit, other, ratio):
    assert unit_ratio(unit, other) == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "other"),
    [("mm", "s"), ("MPa", "N"), ("m", "m^2"), ("foo", "m"), ("m", ""), ("kft", "m"), ("m//s", "m"),
     ("m^", "m"), ("3m", "m"), ("m/", "m"), ("mkm", "m"), ("%", "m")],
)  # fmt: skip
def test_others_do_not(unit, other):
    assert unit_ratio(unit, other) is None
