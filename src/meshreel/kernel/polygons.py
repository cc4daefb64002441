"""Cutting of polygons into triangles, and the polygons of triangles, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call, int32s

AnyIntegers = npt.NDArray[np.integer]
Integers = npt.NDArray[np.int32]


def triangulate(
    sizes: AnyIntegers, corners: AnyIntegers, vertices: npt.NDArray[np.floating]
) -> tuple[Integers, int]:
    """Cut polygons into triangles: as fans from their first corners, or by ear clipping.

    Parameters
    ----------
    sizes : integer array of shape (P,)
        Corners of each polygon, at least 3.
    corners : integer array of shape (sum of sizes,)
        Their vertices, concatenated.
    vertices : float array of shape (V, 3)

    Returns
    -------
    int32 array of shape (sum of sizes - 2, 3)
        The triangles, polygon by polygon, from which `triangle_corners` recovers the corners.
    int
        Number of polygons whose triangles may overlap, since they intersect themselves, or have
        too many corners.
    """
    max_size = int(sizes.max(initial=3))
    triangles = np.empty((len(corners) - 2 * len(sizes), 3), np.int32)
    n_overlapping = call(
        "reel_triangulate",
        np.ascontiguousarray(vertices, np.float64),
        int32s(sizes),
        len(sizes),
        max_size,
        int32s(corners),
        triangles,
        noun="polygons",
        memory_of=("reel_triangulate_memory", max_size),
    )
    return triangles, n_overlapping


def triangle_corners(sizes: AnyIntegers, triangles: AnyIntegers) -> Integers:
    """Return the corner of its polygon at each corner of a triangle, of shape (M, 3).

    Corners are numbered polygon by polygon, as in `triangulate`.

    Raises
    ------
    InvalidInputError
        If the triangles of a polygon do not adjoin.
    """
    max_size = int(sizes.max(initial=3))
    corners = np.empty((len(triangles), 3), np.int32)
    try:
        call(
            "reel_triangle_corners",
            int32s(triangles),
            int32s(sizes),
            len(sizes),
            max_size,
            corners,
            noun="polygons",
            memory_of=("reel_triangle_corners_memory", max_size),
        )
    except CorruptStreamError as error:
        raise InvalidInputError(
            f"the triangles of a polygon do not adjoin in order: {error}"
        ) from error
    return corners
