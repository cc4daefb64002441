"""Surfaces around the axis z: rings of points, and poles or flat ends."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

N_AROUND = 32
"""Points of each ring."""


@dataclass(frozen=True, eq=False)
class Rings:
    """What a surface is at one angle, from the bottom to the top.

    Attributes
    ----------
    radii, heights : float64 array of shape (R,)
        Of the rings.
    bottom, top : float, optional
        Heights of the poles, which are points on the axis; a flat end has none.
    """

    radii: npt.NDArray[np.float64]
    heights: npt.NDArray[np.float64]
    bottom: float | None = None
    top: float | None = None


def revolved(rings: Rings) -> npt.NDArray[np.float64]:
    """Points of shape (V, 3): the pole at the bottom, the rings upwards, the pole at the top."""
    angles = np.arange(N_AROUND) * (2 * np.pi / N_AROUND)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.empty((len(rings.radii), N_AROUND, 3))
    points[..., :2] = rings.radii[:, np.newaxis, np.newaxis] * circle
    points[..., 2] = rings.heights[:, np.newaxis]
    poles = [
        np.array([[0, 0, height]] if height is not None else np.empty((0, 3)))
        for height in (rings.bottom, rings.top)
    ]
    return np.concatenate([poles[0], points.reshape(-1, 3), poles[1]])


def revolved_faces(
    n_rings: int, *, has_bottom: bool, has_top: bool
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Counts and corners of the faces, counter-clockwise seen from outside.

    Triangles at poles, else a face of all corners of a ring; quads between rings.
    """
    around = np.arange(N_AROUND)
    after = np.roll(around, -1)
    start = int(has_bottom)
    low, high = start, start + N_AROUND * (n_rings - 1)
    pole = np.zeros_like(around)
    faces = [around[np.newaxis, ::-1]]
    if has_bottom:
        faces = [np.stack([pole, low + after, low + around], 1)]
    for ring in range(low, high, N_AROUND):
        above = ring + N_AROUND
        faces.append(np.stack([ring + around, ring + after, above + after, above + around], 1))
    if has_top:
        faces.append(np.stack([pole + high + N_AROUND, high + around, high + after], 1))
    else:
        faces.append(high + around[np.newaxis])
    counts = np.concatenate([np.full(len(one), one.shape[1], np.int64) for one in faces])
    return counts, np.concatenate([one.ravel() for one in faces]).astype(np.int32)
