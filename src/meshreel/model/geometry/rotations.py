"""Rotations as unit quaternions x, y, z, w: interpolation, and their matrices."""

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles

Real = TypeVar("Real", Floats, Singles)

MIN_ARC_RAD = 1e-6
"""Angle between rotations below which linear interpolation replaces the spherical one."""


def unit(quaternions: Real) -> Real:
    """Return quaternions of shape (T, 4) with length 1; identity where all components are 0."""
    lengths: Real = np.linalg.norm(quaternions, axis=1, keepdims=True)
    is_zero = lengths[:, 0] == 0
    lengths[is_zero] = 1
    result = quaternions / lengths
    result[is_zero] = 0, 0, 0, 1
    return result


def slerp(first: Real, second: Real, weight: Real) -> Real:
    """Return rotations interpolated spherically along the shorter arc, of shape (T, 4).

    Parameters
    ----------
    first, second : float arrays of shape (T, 4)
        Unit quaternions.
    weight : float array of shape (T, 1)
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
    interpolated: Real = before * first + after * nearer
    return interpolated


def rotation_matrices(quaternions: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the matrices of unit quaternions, of shape (T, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
