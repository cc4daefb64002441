"""Conversion between units of physical quantities, such as MPa and Pa."""

import re
from math import pi

_DIMENSIONS = {
    "m": (1.0, (1, 0, 0, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0, 0)),
    "s": (1.0, (0, 0, 1, 0, 0)),
    "K": (1.0, (0, 0, 0, 1, 0)),
    "A": (1.0, (0, 0, 0, 0, 1)),
    "Hz": (1.0, (0, 0, -1, 0, 0)),
    "N": (1.0, (1, 1, -2, 0, 0)),
    "Pa": (1.0, (-1, 1, -2, 0, 0)),
    "bar": (1e5, (-1, 1, -2, 0, 0)),
    "J": (1.0, (2, 1, -2, 0, 0)),
    "W": (1.0, (2, 1, -3, 0, 0)),
    "V": (1.0, (2, 1, -3, 0, -1)),
}
"""Units that take prefixes: the factor to SI units, and the powers of m, kg, s, K and A."""

_WITHOUT_PREFIX = {
    "in": (0.0254, (1, 0, 0, 0, 0)),
    "ft": (0.3048, (1, 0, 0, 0, 0)),
    "t": (1e3, (0, 1, 0, 0, 0)),
    "lb": (0.45359237, (0, 1, 0, 0, 0)),
    "min": (60.0, (0, 0, 1, 0, 0)),
    "h": (3600.0, (0, 0, 1, 0, 0)),
    "degC": (1.0, (0, 0, 0, 1, 0)),
    "psi": (6894.757293168361, (-1, 1, -2, 0, 0)),
    "ksi": (6894757.293168361, (-1, 1, -2, 0, 0)),
    "rad": (1.0, (0, 0, 0, 0, 0)),
    "deg": (pi / 180, (0, 0, 0, 0, 0)),
}
"""Other units. Differences in degC equal those in K, and bounds are differences."""

_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
_FACTOR = re.compile(r"(^|[*./])([A-Za-z]+)(?:\^?(-?[0-9]))?")


def unit_ratio(unit: str, other: str) -> float | None:
    """Return how many of another unit make up a unit; None if they measure different quantities.

    Parameters
    ----------
    unit, other : str
        Products and quotients of SI units, with prefixes and powers, and of a few others: "MPa",
        "mm/s", "kg*m^2", "N/mm^2", "psi". An unknown unit converts to none.
    """
    first, second = _in_si(unit), _in_si(other)
    if first is None or second is None or first[1] != second[1]:
        return None
    return first[0] / second[0]


def _in_si(text: str) -> tuple[float, tuple[int, ...]] | None:
    """Return the factor of a unit to SI units and its powers of these; None if it is unknown."""
    factor = 1.0
    powers: tuple[int, ...] = (0,) * 5
    if not text or _FACTOR.sub("", text):
        return None
    for operator, symbol, digits in _FACTOR.findall(text):
        unit = _WITHOUT_PREFIX.get(symbol) or _DIMENSIONS.get(symbol)
        if unit is None and symbol[1:] in _DIMENSIONS and symbol[0] in _PREFIXES:
            scale, unit_powers = _DIMENSIONS[symbol[1:]]
            unit = scale * _PREFIXES[symbol[0]], unit_powers
        if unit is None:
            return None
        power = int(digits or 1) * (-1 if operator == "/" else 1)
        factor *= unit[0] ** power
        powers = tuple(a + power * b for a, b in zip(powers, unit[1], strict=True))
    return factor, powers
