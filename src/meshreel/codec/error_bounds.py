"""Parsing of error bounds: percent of the diagonal, or lengths."""

import math
import re
from dataclasses import dataclass

from meshreel.errors import InvalidInputError, Keyword

METERS = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "in": 0.0254, "ft": 0.3048,
}  # fmt: skip
"""Length of each unit of error bounds and of models, in meters."""

MODEL_UNITS = "u"
_BOUND = re.compile(r"(\d+(?:\.\d*)?(?:e[+-]?\d{1,3})?|\.\d+(?:e[+-]?\d{1,3})?)\s*([a-z%]*)")


@dataclass(frozen=True)
class ErrorBound:
    """An upper bound of the distance of each vertex from the original."""

    amount: float
    """Size of the bound, above 0."""
    is_length: bool = False
    """Whether it is a length in model units; else percent of the diagonal of the bounding box of
    all frames.
    """

    def share(self, diagonal: float) -> float:
        """The bound in diagonals, for a diagonal in model units above 0."""
        return self.amount / diagonal if self.is_length else self.amount / 100.0

    def percent(self, diagonal: float) -> float:
        """The bound in percent of the diagonal."""
        return 100.0 * self.amount / diagonal if self.is_length else self.amount

    @property
    def plain(self) -> float | str:
        """The bound in the syntax of `bound_of`: a number of percent, or text such as "0.5u"."""
        return f"{self.amount!r}{MODEL_UNITS}" if self.is_length else self.amount

    def __str__(self) -> str:
        return f"{self.amount:g} {'model units' if self.is_length else '%'}"


def total_bound(bound: float, of_source: float) -> float:
    """Return a bound relative to the original of a lossy source, rounded up to six digits."""
    return float(round_up(bound + of_source, 6)) if of_source else bound


def round_up(number: float, n_digits: int = 4) -> str:
    """Return a number with `n_digits` significant digits, rounded up so that a bound holds."""
    if number <= 0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(number)) + 1 - n_digits)
    # Tolerate rounding errors just above a multiple of the unit.
    return f"{math.ceil(number / unit - 1e-9) * unit:.{n_digits}g}"


def bound_of(bound: float | str, unit: str | None = None, option: str = "max_error") -> ErrorBound:
    """Parse an error bound.

    Parameters
    ----------
    bound : float, or str
        Percent of the diagonal of the bounding box of all frames: 0.1, "0.1", "0.1%". Model units:
        "0.5u". A length: "0.5mm", in any of `METERS`.
    unit : str, optional
        Length unit of the model, also of `METERS`; required for lengths only, because a sequence
        has no unit.
    option : str, default "max_error"
        Name of the parameter, for error messages.

    Raises
    ------
    InvalidInputError
        If it is none of these or not above 0, a length lacks the unit of the model, or a unit is
        given with a bound that is not a length.
    """
    if isinstance(bound, str):
        match = _BOUND.fullmatch(bound.strip().lower())
        if not match:
            raise InvalidInputError(
                Keyword(option),
                f" takes percent of the diagonal (0.1 or 0.1%), model units (0.5u) or a "
                f"length ({', '.join(f'0.5{name}' for name in METERS)}); got {bound!r}",
            )
        amount, suffix = float(match[1]), match[2]
    else:
        amount, suffix = bound, ""
    if not 0 < amount < float("inf"):
        raise InvalidInputError(Keyword(option), f" must be above 0; got {bound}")
    if unit is not None and unit not in METERS:
        raise InvalidInputError(Keyword("unit"), f" is one of {', '.join(METERS)}; got {unit!r}")
    if suffix in METERS:
        if unit is None:
            raise InvalidInputError(
                Keyword(option),
                f" {bound} is a length, but the model has no length unit; give it with ",
                Keyword("unit"),
                f" ({', '.join(METERS)}), or use model units as in 0.5{MODEL_UNITS}",
            )
        return ErrorBound(amount * METERS[suffix] / METERS[unit], is_length=True)
    if suffix not in ("", "%", MODEL_UNITS):
        raise InvalidInputError(
            Keyword(option),
            f" has no unit {suffix!r}; use %, {MODEL_UNITS} (model units), "
            f"{', '.join(METERS)}; got {bound!r}",
        )
    if unit is not None:
        raise InvalidInputError(
            Keyword("unit"),
            f" has no effect on {bound}, which is not a length; omit it, or give ",
            Keyword(option),
            " in mm, cm, m, km, in or ft",
        )
    return ErrorBound(amount, is_length=suffix == MODEL_UNITS)
