"""Polygons as ragged arrays: index arithmetic, triangulation as fans and its inverse."""

from typing import Any

import numpy as np
import numpy.typing as npt

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


def triangulate_fans(counts: Integers, corners: Integers) -> npt.NDArray[np.int32]:
    """Cut each face into a fan of triangles from its first corner, in the order of the faces.

    Parameters
    ----------
    counts, corners : integer arrays
        Number of corners of each face, at least 3; concatenated vertex indices of all faces.

    Returns
    -------
    int32 array of shape (sum of counts - 2, 3).
    """
    n_triangles = counts - 2
    first = np.cumsum(counts) - counts
    second = ragged_indices(first + 1, n_triangles)
    fans = [corners[np.repeat(first, n_triangles)], corners[second], corners[second + 1]]
    return np.stack(fans, axis=1).astype(np.int32)


def join_fans(sizes: Integers, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.int32]:
    """Concatenated corners of the faces that `triangulate_fans` cut.

    Parameters
    ----------
    sizes : integer array of shape (P,)
        Number of corners of each face, at least 3.
    faces : integer array of shape (sum of sizes - 2, 3)
        The triangles, in the order of the faces.

    Returns
    -------
    int32 array of shape (sum of sizes,).
    """
    sizes = np.asarray(sizes, np.int64)
    first = np.cumsum(sizes) - sizes
    first_triangle = np.cumsum(sizes - 2) - (sizes - 2)
    corners = np.empty(int(sizes.sum()), np.int32)
    corners[first], corners[first + 1] = faces[first_triangle, 0], faces[first_triangle, 1]
    corners[ragged_indices(first + 2, sizes - 2)] = faces[:, 2]
    return corners


def fan_corners(sizes: Integers) -> npt.NDArray[np.int32]:
    """Index of the polygon corner at each triangle corner, of shape (M, 3)."""
    sizes = np.asarray(sizes, np.int64)
    return triangulate_fans(sizes, np.arange(int(sizes.sum()), dtype=np.int32))
