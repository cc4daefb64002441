"""Polygons as ragged arrays: index arithmetic, and corners from their triangles."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.kernel.polygons import triangle_corners

Integers = npt.NDArray[np.integer[Any]]


def ragged_indices(starts: Integers, counts: Integers) -> npt.NDArray[np.int64]:
    """Concatenated indices of the ranges ``starts[i] .. starts[i] + counts[i] - 1``.

    Parameters
    ----------
    starts, counts : integer arrays of shape (N,)
        First index and length of each range; lengths are at least 0.

    Returns
    -------
    int64 array of shape (sum of counts,).
    """
    lengths = np.asarray(counts, dtype=np.int64)
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if len(ends) else 0
    return np.repeat(starts - (ends - lengths), lengths) + np.arange(total, dtype=np.int64)


def join_triangles(sizes: Integers, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.int32]:
    """Concatenated corners of the polygons that `meshreel.kernel.polygons.triangulate` cut.

    Parameters
    ----------
    sizes : integer array of shape (P,)
        Number of corners of each polygon, at least 3.
    faces : integer array of shape (sum of sizes - 2, 3)
        The triangles, in the order of the polygons.

    Returns
    -------
    int32 array of shape (sum of sizes,).

    Raises
    ------
    InvalidInputError
        If the triangles of a polygon do not adjoin.
    """
    corners = np.empty(int(np.sum(sizes)), np.int32)
    corners[triangle_corners(sizes, faces)] = faces
    return corners
