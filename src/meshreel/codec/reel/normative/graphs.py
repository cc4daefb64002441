"""Graphs of faces, corners and rows, over which their tracks are predicted.

Faces are adjacent across an edge; corners within a triangle, and across an edge at the same vertex;
rows if any of their corners are. `docs/format.md`, "Tracks".
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.codec.connectivity.triangles import twin_sides
from meshreel.codec.corner_rows import CornerRows
from meshreel.model.geometry.polygons import fan_corners
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer]
Pair = tuple[Integers, Integers]


class ItemGraph(NamedTuple):
    """A graph of items in the form of a mesh, for `FieldMesh`.

    Attributes
    ----------
    faces : int32 array of shape (n, 3)
        Triples of adjacent items; a pair repeats its second item.
    n_items : int
    """

    faces: Faces
    n_items: int


def item_graph(domain: Domain, faces: Faces, surface: Surface, n_verts: int) -> ItemGraph:
    """Return the graph of the polygons or their corners of a decoded mesh.

    Parameters
    ----------
    domain : Domain
    faces : int32 array of shape (M, 3)
    surface : Surface
        Maps polygons to triangles.
    n_verts : int
    """
    sizes = surface.sizes(len(faces))
    twins = twin_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))  # each pair once
    others = twins[sides]
    if domain is Domain.FACE:
        polygons = np.repeat(np.arange(len(sizes)), sizes - 2)
        return _graph([(polygons[sides // 3], polygons[others // 3])], len(sizes))
    corners, first, second = _corners_across(faces, sizes, sides, others)
    along = corners.reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    return _graph([(corners, along), first, second], int(sizes.sum()))


def row_graph(rows: CornerRows, faces: Faces, surface: Surface, n_verts: int) -> ItemGraph:
    """Return the graph of the rows of corners; other parameters as in `item_graph`."""
    sizes, twins = surface.sizes(len(faces)), twin_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))
    corners, *across = _corners_across(faces, sizes, sides, twins[sides])
    pairs = [(rows.of_corners[item], rows.of_corners[other]) for item, other in across]
    at_seams = [(item[item != other], other[item != other]) for item, other in pairs]
    triangles = rows.of_corners[corners].reshape(-1, 3)
    joined = np.concatenate([triangles, _graph(at_seams, rows.n_rows).faces])
    return ItemGraph(np.ascontiguousarray(joined, np.int32), rows.n_rows)


def _corners_across(
    faces: Faces, sizes: Integers, sides: Integers, others: Integers
) -> tuple[Integers, Pair, Pair]:
    """Return adjacent corners of polygons.

    The corner of each corner of a triangle; then, of the faces on both sides of each edge, the two
    corners at its first end, and those at its second.
    """
    corners = fan_corners(sizes).reshape(-1)
    ahead = np.arange(3 * len(faces)).reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    vertices = faces.reshape(-1)
    runs_back = vertices[sides] == vertices[ahead[others]]
    first = np.where(runs_back, ahead[others], others)
    second = np.where(runs_back, others, ahead[others])
    return (
        corners,
        (corners[sides], corners[first]),
        (corners[ahead[sides]], corners[second]),
    )


def _graph(pairs: Sequence[Pair], n_items: int) -> ItemGraph:
    ends = np.concatenate([np.stack([item, other, other], axis=1) for item, other in pairs])
    return ItemGraph(np.ascontiguousarray(ends, np.int32), n_items)
