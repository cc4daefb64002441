"""Normals of a surface that moves, and normals turned from them, by the core."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call

Vertices = npt.NDArray[np.floating[Any]]
Integers = npt.NDArray[np.int32]


def surface_normals(positions: Vertices, faces: Integers, items: Integers | None = None) -> Floats:
    """Normals of length 1, or 0 where there is none: area-weighted means over triangles.

    Parameters
    ----------
    positions : contiguous float32 or float64 array of shape (T, V, 3)
    faces : contiguous int32 array of shape (M, 3)
        Triangles, in the order in which they are summed up.
    items : contiguous int32 array of shape (M,), optional
        The item, such as a polygon, that each triangle is of; each number up to the largest has a
        triangle. None: items are the vertices.

    Returns
    -------
    float64 array of shape (T, N, 3)

    Raises
    ------
    InvalidInputError
        If a face names a vertex that is not there.
    """
    n_frames, n_verts, _ = positions.shape
    n_items = n_verts if items is None else int(items.max(initial=-1)) + 1
    found = np.empty((n_frames, n_items, 3))
    call(
        "reel_normals",
        positions,
        positions.itemsize,
        n_frames,
        n_verts,
        faces,
        len(faces),
        items,
        n_items,
        found,
        what="normals",
    )
    return found


def turns_to(normals: Floats, wanted: Vertices) -> Floats:
    """The numbers of shape (..., 2) by which `turned` makes the wanted normals of others.

    Parameters
    ----------
    normals : contiguous float64 array of shape (..., 3)
    wanted : contiguous float32 or float64 array of shape (..., 3)

    Raises
    ------
    InvalidInputError
        If one cannot be reached: where only one of the two is 0, or nearly the opposite.
    """
    found = np.empty((*normals.shape[:-1], 2))
    call(
        "reel_find_rotations",
        normals,
        wanted,
        wanted.itemsize,
        normals.size // 3,
        found,
        what="normals",
    )
    return found
