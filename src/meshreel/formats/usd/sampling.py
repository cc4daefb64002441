"""At which time codes a mesh has its frames."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

Codes = npt.NDArray[np.float64]

MAX_CODE = 1e9
MAX_FRAMES = 1_000_000
MAX_FILLED = 4
"""Uneven samples are filled up to so many times as many, where their smallest gap divides all."""

TOLERANCE = 1e-6
"""In time codes: what layers that are shifted and scaled may be off."""


def attribute_codes(attribute: Any) -> list[float]:
    """Where an attribute of a prim has samples; every whole code between the knots of a spline."""
    # Splines are newer than the oldest library that is allowed.
    if hasattr(attribute, "HasSpline") and attribute.HasSpline():
        knots = [float(code) for code in attribute.GetSpline().GetKnots()]
        return frame_grid(min(knots), max(knots), 1.0).tolist() if knots else []
    return [float(code) for code in attribute.GetTimeSamples()]


def distinct_codes(codes: list[float]) -> Codes:
    """The codes in ascending order, those that differ by rounding only once.

    Raises
    ------
    FormatError
        If one is so large that neighbours cannot be told apart, or not a number.
    """
    ordered = np.sort(np.asarray(codes, np.float64))
    if len(ordered) and not np.abs(ordered).max() <= MAX_CODE:
        raise FormatError(
            f"has samples from time code {ordered[0]:g} to {ordered[-1]:g}; "
            f"allowed are -{MAX_CODE:g} to {MAX_CODE:g}"
        )
    distinct: Codes = ordered[np.diff(ordered, prepend=-np.inf) > TOLERANCE]
    return distinct


def frame_grid(first: float, last: float, interval: float) -> Codes:
    """Codes from the first to the last, equally far apart.

    Where the last is not at a whole number of intervals, there is one code behind it, so that no
    final pose is lost: USD holds the last sample.

    Raises
    ------
    FormatError
        If there would be more than anyone could want.
    """
    n_intervals = (last - first) / interval - TOLERANCE
    if not n_intervals < MAX_FRAMES - 1:
        raise FormatError(
            f"moves from time code {first:g} to {last:g}, which would be {n_intervals:.3g} frames; "
            f"at most {MAX_FRAMES} are read"
        )
    numbers = np.arange(math.ceil(n_intervals) + 1, dtype=np.float64)
    return snapped(np.float64(first) + interval * numbers)


def snapped(codes: Codes) -> Codes:
    """The codes, whole where they are so but for rounding."""
    whole = np.round(codes)
    return np.where(np.abs(codes - whole) <= TOLERANCE, whole, codes)


def even_interval(codes: Codes) -> float:
    """How far the codes are apart if all are equally far; else, and of a single one, 0."""
    if len(codes) < 2:
        return 0.0
    # Of all together, for single gaps are rounded.
    interval = float(codes[-1] - codes[0]) / (len(codes) - 1)
    expected = codes[0] + interval * np.arange(len(codes))
    is_even = np.abs(codes - expected).max() <= TOLERANCE * max(1.0, interval)
    return float(snapped(np.array(interval))) if is_even else 0.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Where what gives a mesh its positions has samples.

    Attributes
    ----------
    stored : Codes
        Of points and faces.
    keys : Codes
        Of what moves the points from one sample to the next: transforms, joints, shapes.
    """

    stored: Codes
    keys: Codes

    @cached_property
    def all(self) -> Codes:
        """Of either."""
        return distinct_codes([*self.stored, *self.keys])

    def move_between(self, frame_interval: float) -> bool:
        """Whether the mesh moves between its samples too, so that frames can be anywhere.

        Points that have samples as close as frames are a cache, whose samples are its frames.
        """
        most = MAX_FILLED * frame_interval * (1 + TOLERANCE)
        is_cache = len(self.stored) > 1 and np.diff(self.stored).min() <= most
        return len(self.keys) > 1 and not is_cache

    def frames(self, frame_interval: float, origin: float) -> Codes:
        """Where the mesh has its frames; empty if it does not move.

        Parameters
        ----------
        frame_interval : float
            Time codes from one frame of the stage to the next.
        origin : float
            Where one of them is, at or before all samples that move between.
        """
        if self.move_between(frame_interval):
            return sampled_codes(self.all, frame_interval, origin)
        if len(self.keys) < 2 or not (interval := even_interval(own := even_codes(self.stored))):
            return even_codes(self.all)
        keys = even_codes(self.keys)
        first = own[0] - interval * max(0, math.ceil((own[0] - keys[0]) / interval - TOLERANCE))
        last = own[-1] + interval * max(0, math.ceil((keys[-1] - own[-1]) / interval - TOLERANCE))
        return own if (first, last) == (own[0], own[-1]) else frame_grid(first, last, interval)


def sampled_codes(samples: Codes, frame_interval: float, origin: float) -> Codes:
    """Where a mesh that moves between its samples has its frames.

    At its samples if these are one to a frame of the stage, or closer. Keys may be further apart,
    and the way between them curved: there is a frame at every frame of the stage then.
    """
    codes = even_codes(samples)
    if len(codes) < 2 or 0 < even_interval(codes) <= frame_interval * (1 + TOLERANCE):
        return codes
    first = origin + frame_interval * math.floor((samples[0] - origin) / frame_interval + TOLERANCE)
    return frame_grid(first, float(samples[-1]), frame_interval)


def even_codes(samples: Codes) -> Codes:
    """The samples of points and transforms, made even where they are uneven for a plain reason.

    Samples beside whole codes, for motion blur, are left out, but not if only the last is such a
    one: that is the final pose. Where samples are left out since they lie on the line between their
    neighbours, there are frames again. Others stay as they are.
    """
    if len(samples) < 2 or even_interval(samples):
        return samples
    is_whole = np.abs(samples - np.round(samples)) <= TOLERANCE
    if not is_whole[:-1].all() or is_whole[-1]:
        whole = samples[is_whole]
        if even_interval(whole) == 1:
            return whole
    interval = float(snapped(np.diff(samples).min()))
    places = (samples - samples[0]) / interval
    is_on_grid = np.abs(places - np.round(places)).max() <= TOLERANCE * max(1.0, places[-1])
    if is_on_grid and places[-1] < MAX_FILLED * len(samples):
        return frame_grid(float(samples[0]), float(samples[-1]), interval)
    return samples
