"""Surfaces of revolution around the z axis: rings of points between two poles."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

N_AROUND = 32
"""Number of points in a ring."""


@dataclass(frozen=True, eq=False)
class Rings:
    """The profile of a surface of revolution, from bottom to top.

    Attributes
    ----------
    radii, heights : float64 array of shape (R,)
        Radii and heights of the rings.
    bottom, top : float
        Heights of the poles on the axis; for a flat end, the height of its ring.
    """

    radii: npt.NDArray[np.float64]
    heights: npt.NDArray[np.float64]
    bottom: float
    top: float


def revolve(rings: Rings) -> npt.NDArray[np.float64]:
    """Return points of shape (V, 3): bottom pole, rings from bottom to top, top pole."""
    angles = np.arange(N_AROUND) * (2 * np.pi / N_AROUND)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.empty((len(rings.radii), N_AROUND, 3))
    points[..., :2] = rings.radii[:, np.newaxis, np.newaxis] * circle
    points[..., 2] = rings.heights[:, np.newaxis]
    bottom, top = [[0.0, 0.0, rings.bottom]], [[0.0, 0.0, rings.top]]
    return np.concatenate([bottom, points.reshape(-1, 3), top])


def revolved_faces(n_rings: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Return counts and corners of the faces, counterclockwise from outside.

    There are triangles at the poles and quads between rings. Flat ends are triangles around a pole
    too: the fan of a single polygon would shade its first corner differently.
    """
    around = np.arange(N_AROUND)
    after = np.roll(around, -1)
    low, high = 1, 1 + N_AROUND * (n_rings - 1)
    pole = np.zeros_like(around)
    faces = [np.stack([pole, low + after, low + around], 1)]
    for ring in range(low, high, N_AROUND):
        above = ring + N_AROUND
        faces.append(np.stack([ring + around, ring + after, above + after, above + around], 1))
    faces.append(np.stack([pole + high + N_AROUND, high + around, high + after], 1))
    counts = np.concatenate([np.full(len(one), one.shape[1], np.int64) for one in faces])
    return counts, np.concatenate([one.ravel() for one in faces]).astype(np.int32)


def rim_edges(n_rings: int) -> npt.NDArray[np.int64]:
    """Return the edges of the lowest rings as pairs of points, of shape (R * N_AROUND, 2)."""
    around = np.arange(N_AROUND)
    starts = 1 + N_AROUND * np.arange(n_rings)[:, np.newaxis]
    return np.stack([starts + around, starts + np.roll(around, -1)], axis=2).reshape(-1, 2)
