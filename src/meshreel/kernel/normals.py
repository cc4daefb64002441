"""Normals of a moving surface, and rotations between normals, by the core."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call

Vertices = npt.NDArray[np.floating[Any]]
Integers = npt.NDArray[np.int32]


def surface_normals(positions: Vertices, faces: Integers, items: Integers | None = None) -> Floats:
    """Unit normals, area-weighted means over triangles; 0 where undefined.

    Parameters
    ----------
    positions : contiguous float32 or float64 array of shape (T, V, 3)
    faces : contiguous int32 array of shape (M, 3)
        Triangles, in the order of summation.
    items : contiguous int32 array of shape (M,), optional
        The item, such as a polygon, of each triangle; every item up to the largest has a triangle.
        None: items are the vertices.

    Returns
    -------
    float64 array of shape (T, N, 3)

    Raises
    ------
    InvalidInputError
        If a face contains a vertex that does not exist.
    """
    n_frames, n_verts, _ = positions.shape
    n_items = n_verts if items is None else int(items.max(initial=-1)) + 1
    normals = np.empty((n_frames, n_items, 3))
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
        normals,
        noun="normals",
    )
    return normals


def find_rotations(normals: Floats, targets: Vertices) -> Floats:
    """Rotations of shape (..., 2), two numbers each, that turn normals into target normals.

    docs/format.md, "Tracks", defines the numbers.

    Parameters
    ----------
    normals : contiguous float64 array of shape (..., 3)
    targets : contiguous float32 or float64 array of shape (..., 3)

    Raises
    ------
    InvalidInputError
        If no rotation reaches a target: only one of both normals is 0, or they are nearly opposite.
    """
    rotations = np.empty((*normals.shape[:-1], 2))
    call(
        "reel_find_rotations",
        normals,
        targets,
        targets.itemsize,
        normals.size // 3,
        rotations,
        noun="normals",
    )
    return rotations
