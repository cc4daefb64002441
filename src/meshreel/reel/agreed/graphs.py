"""The graph that the values of a track lie on, where they are not of vertices.

Faces are next to each other across an edge; corners beside each other in a triangle, and across an
edge at the same vertex. `docs/format.md`, "Tracks".
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.triangles import twin_sides
from meshreel.geometry.fans import fan_corners
from meshreel.sequence import Faces
from meshreel.surface import Domain, Surface

Integers = npt.NDArray[np.integer]


class ItemGraph(NamedTuple):
    """A graph of items, as `FieldMesh` takes it.

    Attributes
    ----------
    faces : int32 array of shape (n, 3)
        Items at its corners are next to each other; where two are, the second stands twice.
    n_items : int
    """

    faces: Faces
    n_items: int


def item_graph(domain: Domain, faces: Faces, surface: Surface, n_verts: int) -> ItemGraph:
    """The graph of the faces or corners of a mesh, as they go out.

    Parameters
    ----------
    domain : Domain
        Faces, which are polygons, or their corners.
    faces : int32 array of shape (M, 3)
    surface : Surface
        Says which triangles a polygon is cut into.
    n_verts : int
    """
    sizes = surface.sizes(len(faces))
    twins = twin_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))  # one of each two
    others = twins[sides]
    if domain is Domain.FACE:
        polygons = np.repeat(np.arange(len(sizes)), sizes - 2)
        return _graph([(polygons[sides // 3], polygons[others // 3])], len(sizes))
    corners = fan_corners(sizes).reshape(-1)
    ahead = np.arange(3 * len(faces)).reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    vertices = faces.reshape(-1)
    runs_back = vertices[sides] == vertices[ahead[others]]
    first = np.where(runs_back, ahead[others], others)
    second = np.where(runs_back, others, ahead[others])
    pairs = [
        (corners, corners[ahead]),
        (corners[sides], corners[first]),
        (corners[ahead[sides]], corners[second]),
    ]
    return _graph(pairs, int(sizes.sum()))


def _graph(pairs: Sequence[tuple[Integers, Integers]], n_items: int) -> ItemGraph:
    ends = np.concatenate([np.stack([one, other, other], axis=1) for one, other in pairs])
    return ItemGraph(np.ascontiguousarray(ends, np.int32), n_items)
