"""Parsing of error bounds of tracks, 0.1%, 500Pa, 0.5deg, 8bit, exact, drop, and their units."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from meshreel.codec.config import EncoderConfig
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.targets import error_scale
from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.model.notes import Notes
from meshreel.model.tracks import KIND_ROWS, ErrorMeasure, TrackSource, track_by_name

TrackTargets = Mapping[str, float | str]
"""Error bounds of tracks by name, as users write them."""


class Measure(Enum):
    """Quantity that a bound limits."""

    SHARE = "percent of the range"
    UNITS = "units of the track"
    ANGLE = "degrees"
    NUMBER = "each number"
    EXACT = "lossless"
    DROP = "omitted"


@dataclass(frozen=True)
class TrackBound:
    """Bound of the error of each value of a track."""

    measure: Measure
    """SHARE and UNITS limit the length of the difference of two values, ANGLE the angle between two
    normals, NUMBER the difference of each number of a value.
    """
    amount: float = 0.0
    """Size of the bound, above 0; not used by EXACT and DROP."""
    origin: str = field(default=Message(Keyword("tracks")), compare=False)
    """What set the bound, such as "1 %, quality 80"."""


EXACT, DROP = TrackBound(Measure.EXACT), TrackBound(Measure.DROP)

MAX_ANGLE_DEG = 30.0
"""Maximum bound in degrees. Beyond it, missing directions, whose length is 0, could not be
distinguished from others."""

MAX_BITS = 52
"""Maximum number of bits of a color; more exceed the precision of float64 near 1."""

_UNIT = re.compile(r"(?!bit$|deg$)[^\W\d_][\w/^*.-]*")
"""Text that may be a unit of a physical quantity: Pa, m/s, kg*m^2."""

_BOUND = re.compile(r"=?\s*((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]{1,3})?)(.*)")


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
    "deg": (math.pi / 180, (0, 0, 0, 0, 0)),
}
"""Other units. Differences in degC equal those in K, and bounds are differences."""

_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
_FACTOR = re.compile(r"(^|[*./])([A-Za-z]+)(?:\^?(-?[0-9]))?")


def without_units(
    tracks: Mapping[str, TrackSource], targets: TrackTargets, notes: Notes
) -> dict[str, float | str]:
    """Return targets in which bounds of tracks without a unit are plain numbers.

    Many files store no units, so that 500Pa means 500 and a note reports it. Other bounds are
    unchanged.
    """
    plain = dict(targets)
    for name, bound in targets.items():
        match = _BOUND.fullmatch(str(bound).strip())
        track = tracks.get(name)
        if track is None or match is None or track.unit or not KIND_ROWS[track.kind].has_unit:
            continue
        if _UNIT.fullmatch(match[2].strip()):
            plain[name] = match[1]
            notes.unknown(
                f"track {name!r} has no unit in the file; its bound {bound} is read as {match[1]}"
            )
    return plain


def kept_bounds(
    config: EncoderConfig, tracks: Mapping[str, TrackSource], targets: TrackTargets | None
) -> dict[str, TrackBound]:
    """Return the bound of each track that is not dropped: that in `targets`, or the default.

    Raises
    ------
    InvalidInputError
        If a track does not exist, a bound does not suit its kind, or the method does not support
        tracks.
    """
    bounds = {name: default_bound(track, config) for name, track in tracks.items()}
    for name, bound in (targets or {}).items():
        bounds[name] = bound_of_track(bound, name, track_by_name(tracks, name))
    coded = {name: bound for name, bound in bounds.items() if bound != DROP}
    if coded and config.positions_only:
        names = ", ".join(coded)
        raise InvalidInputError(
            f"method {config.method} codes positions only; drop the tracks ({names}), or use reel"
        )
    return coded


def default_bound(track: TrackSource, config: EncoderConfig) -> TrackBound:
    """Return the default bound of a track, with what set it.

    The option `bound` is in percent of the range, for normals of the diameter of the unit sphere.
    Without it, the bound depends on the kind, and on the quality if that is the target.
    """
    if config.method == LOSSLESS:
        return replace(EXACT, origin=Message(Keyword("lossless")))
    if track.dtype.kind != "f":
        return replace(EXACT, origin="integers")
    row, percent, quality = KIND_ROWS[track.kind], config.bound_percent, config.track_quality
    bound, origin = bound_of_track(row.default_bound, "", track), "default"
    if percent is not None:
        angle = math.degrees(2.0 * math.asin(min(percent / 100.0, 1.0)))
        is_angle, origin = row.is_direction, Message(Keyword("bound"))
        bound = TrackBound(Measure.ANGLE, angle) if is_angle else TrackBound(Measure.SHARE, percent)
    elif quality is not None:
        origin, scale = f"quality {quality:g}", row.visible_ratio * error_scale(quality)
        bound = replace(bound, amount=bound.amount * scale)
    if bound.measure is Measure.SHARE:
        origin = Message.prefixed(f"{bound.amount:.3g} %, ", origin)
    amount = min(bound.amount, MAX_ANGLE_DEG) if row.is_direction else bound.amount
    return TrackBound(bound.measure, amount, origin)


def bound_of_track(bound: float | str, name: str, track: TrackSource) -> TrackBound:
    """Parse the bound of a track.

    Parameters
    ----------
    bound : float, or str
        In units of the track: 500, "500", "=500", "500Pa", or "0.5kPa", which is converted. "0.1%"
        of its range; "0.5deg" for normals; "8bit" for colors; "exact"; "drop".
    name : str
        Name of the track, for error messages.

    Raises
    ------
    InvalidInputError
        If it is none of these, or does not suit the track.
    """
    text = str(bound).strip()
    keywords = {"exact": EXACT, "drop": DROP}
    if text.lower() in keywords:
        return keywords[text.lower()]
    match = _BOUND.fullmatch(text)
    if not match:
        raise InvalidInputError(f"track {name!r}: {_allowed(track)}; got {bound!r}")
    amount, unit = float(match[1]), match[2].strip()
    if track.dtype.kind != "f":
        raise InvalidInputError(
            f"track {name!r} has integers, which are lossless; use exact or drop, not {bound!r}"
        )
    if not 0 < amount < math.inf:
        raise InvalidInputError(f"track {name!r}: a bound must be above 0; got {bound!r}")
    row = KIND_ROWS[track.kind]
    ratio = 1.0 if unit in ("", track.unit) else unit_ratio(unit, track.unit)
    if row.is_direction:
        if unit == "deg" and amount <= MAX_ANGLE_DEG:
            return TrackBound(Measure.ANGLE, amount)
        if unit == "deg":
            raise InvalidInputError(
                f"track {name!r}: an angle is at most {MAX_ANGLE_DEG:g}deg; got {bound!r}"
            )
    elif unit == "bit" and row.error is ErrorMeasure.NUMBER:
        if not 1 <= amount <= MAX_BITS:
            raise InvalidInputError(
                f"track {name!r}: colors take 1bit to {MAX_BITS}bit, or exact; got {bound!r}"
            )
        return TrackBound(Measure.NUMBER, 0.5 / (2.0**amount - 1.0))
    elif unit == "%":
        return TrackBound(Measure.SHARE, amount)
    elif ratio is not None:
        return TrackBound(Measure.UNITS, amount * ratio)
    raise InvalidInputError(f"track {name!r}: {_allowed(track)}; got {bound!r}")


def _allowed(track: TrackSource) -> str:
    """Describe the bounds that a track supports."""
    unit, row = track.unit or "", KIND_ROWS[track.kind]
    plain = "a number such as 500 (the track has no unit)"
    allowed = ["0.1% of its range"]
    allowed.append(f"500{unit} in its unit or one that converts to it" if unit else plain)
    if row.is_direction:
        allowed = ["an angle such as 0.5deg"]
    elif row.error is ErrorMeasure.NUMBER:
        allowed.append("8bit")
    return f"a bound is {', '.join(allowed)}, exact or drop"


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
