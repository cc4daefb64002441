"""Which values of an attribute are near each other, by the faces whose corners have them."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.connectivity.triangles import twin_sides
from meshreel.codec.entropy.tables import Along
from meshreel.kernel.patterns import Expected, expected_along
from meshreel.model.geometry.fans import fan_corners, join_fans
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer]
Faces = npt.NDArray[np.int32]


def along_faces(
    domain: Domain, rows: Integers | None, surface: Surface, faces: Faces
) -> Along | None:
    """From which other rows of its table each row of an attribute is expected; None if unknown.

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

    def along(n_rows: int) -> Expected:
        return expected_along(used, twin_sides(used.astype(np.int32), n_rows), n_rows)

    return along


def distinct_rows(values: npt.NDArray[np.generic], places: Integers) -> tuple[Integers, Integers]:
    """The first item of each different value at a place, and the number of each item's among them.

    Values at one place are the same if their bits are.
    """
    patterns = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), -1)
    keys = np.concatenate([np.asarray(places, ">i8")[:, None].view(np.uint8), patterns], axis=1)
    whole = np.ascontiguousarray(keys).view(np.dtype((np.void, keys.shape[1])))[:, 0]
    _, first, number = np.unique(whole, return_index=True, return_inverse=True)
    in_turn = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[in_turn] = np.arange(len(first))
    return first[in_turn], rank[number]


def places_of(domain: Domain, surface: Surface, faces: Faces, n_items: int) -> Integers:
    """The place of each item: corners of faces are at their vertices, all others at one place."""
    if domain is not Domain.CORNER:
        return np.zeros(n_items, np.int64)
    return join_fans(surface.sizes(len(faces)), faces)
