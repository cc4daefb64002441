"""The error bounds at which a track is measured."""

from dataclasses import dataclass

import numpy as np

from meshreel.codec.track_bounds import DROP, EXACT, Measure, bound_of_track
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import TrackKind, TrackSource, value_range

QUICK_PERCENT, PERCENT = (1.0, 0.1, 0.01), (3.0, 1.0, 0.3, 0.1, 0.03, 0.01)
QUICK_DEG, DEG = (2.0, 0.5), (4.0, 2.0, 1.0, 0.5, 0.25, 0.1)
QUICK_BITS, BITS = (6, 8), (4, 5, 6, 8, 10, 12)
EXACTLY = "exact"


@dataclass(frozen=True)
class Level:
    """An error bound for all codecs.

    Attributes
    ----------
    text : str
        As for `--track NAME=` of `meshreel encode`.
    limit : float
        Largest error of a value, in the unit of `meshreel.compare`; 0 is lossless.
    """

    text: str
    limit: float


def levels_of(track: TrackSource, *, quick: bool) -> list[Level]:
    """The levels for a track, from coarse to fine; integers are coded only exactly."""
    texts: list[str] = []
    if track.dtype.kind != "f":
        pass
    elif track.kind is TrackKind.NORMAL:
        texts = [f"{angle:g}deg" for angle in (QUICK_DEG if quick else DEG)]
    elif track.kind is TrackKind.COLOR:
        texts = [f"{bits}bit" for bits in (QUICK_BITS if quick else BITS)]
    else:
        texts = [f"{share:g}%" for share in (QUICK_PERCENT if quick else PERCENT)]
    levels = [level_of(text, track) for text in texts]
    return [*(level for level in levels if level.limit > 0), Level(EXACTLY, 0.0)]


def level_of(text: str, track: TrackSource) -> Level:
    """Parse a bound for a track.

    Parameters
    ----------
    text : str
        As for `meshreel.codec.track_bounds.bound_of_track`, except "drop".

    Raises
    ------
    InvalidInputError
        If the bound is invalid for the track.
    """
    bound = bound_of_track(text, "", track)
    if bound == DROP:
        raise InvalidInputError("a track that is dropped cannot be measured; give it a bound")
    if bound == EXACT:
        return Level(EXACTLY, 0.0)
    if bound.measure is not Measure.SHARE:
        return Level(text, bound.amount)
    low, high = np.nan_to_num(value_range(track))
    return Level(text, bound.amount / 100 * float(np.linalg.norm(high - low)))
