"""Triangulation of polygons as fans from their first corners, and its inverse."""

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.ragged import Integers, ragged_indices


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
