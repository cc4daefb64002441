"""Interpolation between the keys of an animation, in all modes of glTF."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from meshreel.arrays import Floats

MIN_ARC_RAD = 1e-6
"""Angle between rotations below which linear interpolation replaces the spherical one."""


class Interpolation(StrEnum):
    """Interpolation modes of glTF."""

    LINEAR = "LINEAR"
    STEP = "STEP"
    CUBICSPLINE = "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class Curve:
    """Keyframes of a property.

    Attributes
    ----------
    keys_s : float64 array of shape (N,)
        Key times, ascending, at least one.
    values : float64 array of shape (N, C)
    interpolation : Interpolation
    tangents : tuple of two float64 arrays of shape (N, C), optional
        In-tangents and out-tangents of a cubic spline.
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
        """Whether values between two keys are not on the straight line between them."""
        if len(self.keys_s) == 1 or self.interpolation is Interpolation.STEP:
            return False
        return self.is_rotation or self.interpolation is Interpolation.CUBICSPLINE

    def at(self, times_s: Floats) -> Floats:
        """Return the values at times of shape (T,), as (T, C), constant beyond the keys."""
        last = len(self.keys_s) - 1
        before = np.clip(np.searchsorted(self.keys_s, times_s, "right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        if self.interpolation is Interpolation.STEP:
            return self._unit(self.values[before])
        span = self.keys_s[after] - self.keys_s[before]
        elapsed = times_s - self.keys_s[before]
        weight = np.clip(elapsed / np.where(span > 0, span, np.inf), 0, 1)[:, np.newaxis]
        first, second = self.values[before], self.values[after]
        if self.tangents is not None:
            in_tangents, out_tangents = self.tangents[0][after], self.tangents[1][before]
            span = span[:, np.newaxis]
            return self._unit(
                hermite(first, span * out_tangents, second, span * in_tangents, weight)
            )
        if self.is_rotation:
            return self._unit(slerp(first, second, weight))
        return (1 - weight) * first + weight * second

    def _unit(self, values: Floats) -> Floats:
        return unit(values) if self.is_rotation else values


def hermite(
    first: Floats, out_tangent: Floats, second: Floats, in_tangent: Floats, s: Floats
) -> Floats:
    """Return values of a cubic spline at parameters s from 0 to 1, all of shape (T, C).

    Tangents are scaled by the interval between the keys.
    """
    return (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * out_tangent
        + (3 * s**2 - 2 * s**3) * second
        + (s**3 - s**2) * in_tangent
    )


def slerp(first: Floats, second: Floats, weight: Floats) -> Floats:
    """Return rotations interpolated spherically along the shorter arc, of shape (T, 4).

    Parameters
    ----------
    first, second : float64 arrays of shape (T, 4)
        Unit quaternions.
    weight : float64 array of shape (T, 1)
    """
    cosine = (first * second).sum(axis=1, keepdims=True)
    nearer = np.where(cosine < 0, -second, second)
    # From the chord, which is accurate for small angles, unlike the arc cosine.
    chord = np.linalg.norm(nearer - first, axis=1, keepdims=True)
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    is_arc = angle > MIN_ARC_RAD
    sine = np.where(is_arc, np.sin(angle), 1)
    before = np.where(is_arc, np.sin((1 - weight) * angle) / sine, 1 - weight)
    after = np.where(is_arc, np.sin(weight * angle) / sine, weight)
    interpolated: Floats = before * first + after * nearer
    return interpolated


def unit(quaternions: Floats) -> Floats:
    """Return quaternions of shape (T, 4) with length 1; identity where all components are 0."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.where(lengths > 0, quaternions / np.where(lengths > 0, lengths, 1), [0.0, 0, 0, 1])
