"""Rows of attribute tables: prediction along faces, and sharing between corners."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.model.geometry.polygons import fan_corners, join_fans
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer]
Faces = npt.NDArray[np.int32]


def faces_of_rows(
    domain: Domain, rows: Integers | None, surface: Surface, faces: Faces
) -> Faces | None:
    """Return the rows of an attribute at the corners of each triangle, or None for faces.

    Parameters
    ----------
    rows : integer array or None
        The row of each vertex or corner; None if each has its own, in order.
    faces : int32 array of shape (M, 3)
    """
    if domain is Domain.FACE:
        return None
    corners = faces if domain is Domain.VERTEX else fan_corners(surface.sizes(len(faces)))
    used = corners if rows is None else np.asarray(rows)[corners]
    return used.astype(np.int32)


def distinct_rows(values: npt.NDArray[np.generic], places: Integers) -> tuple[Integers, Integers]:
    """Return the first item of each distinct value at each place, and the value of each item.

    Values are equal if their bits are.
    """
    records = rows_as_bytes(places.astype(np.int64), values)
    _, first, number = np.unique(records, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    return first[order], rank[number]


def places_of(domain: Domain, surface: Surface, faces: Faces, n_items: int) -> Integers:
    """Return the place of each item: the vertex of a corner, 0 for other items."""
    if domain is not Domain.CORNER:
        return np.zeros(n_items, np.int64)
    return join_fans(surface.sizes(len(faces)), faces)
