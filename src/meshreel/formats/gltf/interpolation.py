"""Values between the keys of an animation, by each of the ways that glTF has."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from meshreel.arrays import Floats

NEARLY_PARALLEL = 1e-6
"""Radians between rotations below which a straight line is the same as an arc."""


class Interpolation(StrEnum):
    """How values are found between two keys."""

    LINEAR = "LINEAR"
    STEP = "STEP"
    CUBICSPLINE = "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class Curve:
    """Values at times.

    Attributes
    ----------
    keys_s : float64 array of shape (N,)
        Ascending, at least one.
    values : float64 array of shape (N, C)
    tangents : tuple of two float64 arrays of shape (N, C), optional
        Arriving at each key and leaving it, of a cubic spline.
    is_rotation : bool
        Whether values are quaternions.
    """

    keys_s: Floats
    values: Floats
    interpolation: Interpolation
    tangents: tuple[Floats, Floats] | None = None
    is_rotation: bool = False

    @property
    def is_curved(self) -> bool:
        """Whether values between two keys are not on a straight line between theirs."""
        if len(self.keys_s) == 1 or self.interpolation is Interpolation.STEP:
            return False
        return self.is_rotation or self.interpolation is Interpolation.CUBICSPLINE

    def at(self, times_s: Floats) -> Floats:
        """The values at times of shape (T,), of shape (T, C); beyond the keys those of the last."""
        last = len(self.keys_s) - 1
        before = np.clip(np.searchsorted(self.keys_s, times_s, "right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        if self.interpolation is Interpolation.STEP:
            return self._unit(self.values[before])
        span = self.keys_s[after] - self.keys_s[before]
        passed = times_s - self.keys_s[before]
        share = np.clip(passed / np.where(span > 0, span, np.inf), 0, 1)[:, np.newaxis]
        first, second = self.values[before], self.values[after]
        if self.tangents is not None:
            arriving, leaving = self.tangents[0][after], self.tangents[1][before]
            span = span[:, np.newaxis]
            return self._unit(hermite(first, span * leaving, second, span * arriving, share))
        if self.is_rotation:
            return self._unit(slerp(first, second, share))
        return (1 - share) * first + share * second

    def _unit(self, values: Floats) -> Floats:
        return unit(values) if self.is_rotation else values


def hermite(first: Floats, leaving: Floats, second: Floats, arriving: Floats, s: Floats) -> Floats:
    """Values of a cubic spline at a share s of the way, all of shape (T, C).

    Tangents are changes over the whole way.
    """
    return (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * leaving
        + (3 * s**2 - 2 * s**3) * second
        + (s**3 - s**2) * arriving
    )


def slerp(first: Floats, second: Floats, share: Floats) -> Floats:
    """Rotations a share of the way from one to another, the shorter way around.

    Parameters
    ----------
    first, second : float64 arrays of shape (T, 4)
        Unit quaternions.
    share : float64 array of shape (T, 1)
    """
    cosine = (first * second).sum(axis=1, keepdims=True)
    nearer = np.where(cosine < 0, -second, second)
    # By the chord, which is exact where the angle is small, unlike the arc of its cosine.
    chord = np.linalg.norm(nearer - first, axis=1, keepdims=True)
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    is_arc = angle > NEARLY_PARALLEL
    sine = np.where(is_arc, np.sin(angle), 1)
    before = np.where(is_arc, np.sin((1 - share) * angle) / sine, 1 - share)
    after = np.where(is_arc, np.sin(share * angle) / sine, share)
    between: Floats = before * first + after * nearer
    return between


def unit(quaternions: Floats) -> Floats:
    """Quaternions of shape (T, 4) of length 1; no rotation where all four numbers are 0."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.where(lengths > 0, quaternions / np.where(lengths > 0, lengths, 1), [0.0, 0, 0, 1])
