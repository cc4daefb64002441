"""How exact a track is to come back, as users write it: 0.1%, 500Pa, 0.5deg, 8bit, exact, drop."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from meshreel.codec.config import EncoderConfig
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import TrackKind, TrackSource, track_by_name

TrackTargets = Mapping[str, float | str]
"""What is asked of tracks, by their names."""


class Measure(Enum):
    """What a bound limits."""

    SHARE = "percent of the range"
    UNITS = "units of the track"
    ANGLE = "degrees"
    NUMBER = "each number"
    EXACT = "nothing may change"
    DROP = "the track is left out"


@dataclass(frozen=True)
class TrackBound:
    """A bound of the error of each value of a track.

    Attributes
    ----------
    measure : Measure
        SHARE and UNITS limit the length of the difference of two values, ANGLE the angle between
        two normals, NUMBER the difference of each number of a value.
    amount : float
        Above 0; not used by EXACT and DROP.
    """

    measure: Measure
    amount: float = 0.0


EXACT, DROP = TrackBound(Measure.EXACT), TrackBound(Measure.DROP)

DEFAULTS: Mapping[TrackKind, TrackBound] = {
    **dict.fromkeys(TrackKind, TrackBound(Measure.SHARE, 0.1)),
    TrackKind.NORMAL: TrackBound(Measure.ANGLE, 0.5),
    TrackKind.COLOR: TrackBound(Measure.NUMBER, 0.5 / 255),
    TrackKind.UV: TrackBound(Measure.UNITS, 0.5 / 4096),
}
"""Bounds of floats of each kind where nothing is asked for: colours as near as 8 bits are, texture
coordinates half a texel of a texture of 4096. Integers come back exactly."""

LARGEST_ANGLE = 30.0
"""In degrees. Of coarser normals the length would say nothing about whether they are there."""

MOST_BITS = 52
"""Bits of a color; more are finer than float64 is near 1."""

_UNIT = re.compile(r"(?!bit$|deg$)[^\W\d_][\w/^*.-]*")
"""Text that may be a unit of a physical quantity: Pa, m/s, kg*m^2."""

PHYSICAL = frozenset({TrackKind.SCALAR, TrackKind.VECTOR, TrackKind.VELOCITY, TrackKind.OTHER})
"""Kinds of tracks that may have a unit."""

_BOUND = re.compile(r"=?\s*((?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]{1,3})?)(.*)")


def track_bounds(
    tracks: Mapping[str, TrackSource],
    targets: TrackTargets | None,
    default: TrackBound | None = None,
) -> dict[str, TrackBound]:
    """The bound of each track of a sequence.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    targets : mapping of str to str or float, or None
        What is asked of some of them.
    default : TrackBound, optional
        Of the others; that of their kind if it is not given.

    Raises
    ------
    InvalidInputError
        If there is no track of a name, or a bound is not for its kind.
    """
    asked = dict(targets or {})
    for name in asked:
        track_by_name(tracks, name)
    return {
        name: bound_of_track(asked[name], name, track)
        if name in asked
        else default or default_bound(track)
        for name, track in tracks.items()
    }


def without_units(
    tracks: Mapping[str, TrackSource], targets: TrackTargets, notes: list[str]
) -> dict[str, float | str]:
    """Return targets in which bounds of tracks that have no unit are plain numbers.

    Many files name no units, so that 500Pa can only be taken as 500, which a note says. Bounds
    that are no such text stay as they are.

    Parameters
    ----------
    tracks : mapping of str to TrackSource
    targets : mapping of str to str or float
    """
    plain = dict(targets)
    for name, given in targets.items():
        found = _BOUND.fullmatch(str(given).strip())
        track = tracks.get(name)
        if track is None or found is None or track.unit or track.kind not in PHYSICAL:
            continue
        if _UNIT.fullmatch(found[2].strip()):
            plain[name] = found[1]
            notes.append(
                f"track {name!r} has no unit in the file; its bound {given} is taken as {found[1]}"
            )
    return plain


def kept_bounds(
    config: EncoderConfig, tracks: Mapping[str, TrackSource], targets: TrackTargets | None
) -> dict[str, TrackBound]:
    """The bound of each track that is kept.

    Raises
    ------
    InvalidInputError
        If a bound is not for its track, or the method has no tracks.
    """
    default = EXACT if config.lossless else None
    bounds = track_bounds(tracks, targets, default)
    kept = {name: bound for name, bound in bounds.items() if bound != DROP}
    if kept and not config.method_row.has_tracks:
        names = ", ".join(kept)
        raise InvalidInputError(
            f"method {config.method} codes positions only; drop the tracks ({names}), or use reel"
        )
    return kept


def default_bound(track: TrackSource) -> TrackBound:
    """The bound of a track that nothing is asked of."""
    return DEFAULTS[track.kind] if track.dtype.kind == "f" else EXACT


def bound_of_track(given: float | str, name: str, track: TrackSource) -> TrackBound:
    """The bound that a number or a text means for a track.

    Parameters
    ----------
    given : float, or str
        In units of the track: 500, "500", "=500", "500Pa". "0.1%" of its range; "0.5deg" of
        normals; "8bit" of colours; "exact"; "drop".
    name : str
        Of the track, for error messages.

    Raises
    ------
    InvalidInputError
        If it is none of these, or not for this track.
    """
    text = str(given).strip()
    words = {"exact": EXACT, "drop": DROP}
    if text.lower() in words:
        return words[text.lower()]
    found = _BOUND.fullmatch(text)
    if not found:
        raise InvalidInputError(f"track {name!r}: {_allowed(track)}; got {given!r}")
    amount, written = float(found[1]), found[2].strip()
    if track.dtype.kind != "f":
        raise InvalidInputError(
            f"track {name!r} has integers, which come back exactly; ask for exact or drop, not "
            f"for {given!r}"
        )
    if not 0 < amount < math.inf:
        raise InvalidInputError(f"track {name!r}: a bound must be above 0; got {given!r}")
    if written == "deg" and track.kind is TrackKind.NORMAL:
        if amount > LARGEST_ANGLE:
            raise InvalidInputError(
                f"track {name!r}: normals may be off by up to {LARGEST_ANGLE:g}deg; got {given!r}"
            )
        return TrackBound(Measure.ANGLE, amount)
    if written == "bit" and track.kind is TrackKind.COLOR:
        if not 1 <= amount <= MOST_BITS:
            raise InvalidInputError(
                f"track {name!r}: colors have 1bit to {MOST_BITS}bit, or are exact; got {given!r}"
            )
        return TrackBound(Measure.NUMBER, 0.5 / (2.0**amount - 1.0))
    if written == "%" and track.kind is not TrackKind.NORMAL:
        return TrackBound(Measure.SHARE, amount)
    if written in ("", track.unit) and track.kind is not TrackKind.NORMAL:
        return TrackBound(Measure.UNITS, amount)
    raise InvalidInputError(f"track {name!r}: {_allowed(track)}; got {given!r}")


def _allowed(track: TrackSource) -> str:
    """What a track takes, in words."""
    unit = track.unit or ""
    ways = ["0.1% of its range"]
    if track.kind is TrackKind.NORMAL:
        ways = ["an angle such as 0.5deg"]
    else:
        ways.append(f"500{unit} in its unit" if unit else "a number such as 500, it has no unit")
    if track.kind is TrackKind.COLOR:
        ways.append("8bit")
    return f"a bound is {', '.join(ways)}, exact or drop"
