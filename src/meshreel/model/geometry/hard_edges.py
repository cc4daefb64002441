"""Hard edges: where faces that share an edge do not share normals, and normals by them.

Faces at a vertex that are joined across edges that are not hard have one normal there, the mean of
theirs by area. At a vertex without a hard edge that is the normal of the vertex.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import surface_normals
from meshreel.model.geometry.fans import join_fans, triangulate_fans
from meshreel.model.geometry.ragged import Integers
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Surface

Int64s = npt.NDArray[np.int64]
Int32s = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SharedEdges:
    """Edges that at least two sides of faces lie on, in the order of their first sides.

    Attributes
    ----------
    ends : int64 array of shape (E, 2)
        Vertices of each edge, the lower first.
    of_side : int64 array of shape (C,)
        The edge from each corner to the next of its face; -1 if no other side lies on it.
    """

    ends: Int64s
    of_side: Int64s


@dataclass(frozen=True, eq=False)
class NormalRows:
    """Which corners of faces have the same normal.

    Attributes
    ----------
    of_corner : int32 array of shape (C,)
        The row of each corner. The first corner of vertex v has row v.
    vertices : int32 array of shape (R,)
        The vertex of each row; R is V where no edge is hard.
    """

    of_corner: Int32s
    vertices: Int32s


def next_corners(counts: Integers) -> Int64s:
    """The corner behind each corner of its face, of shape (C,); behind the last is the first."""
    counts = np.asarray(counts, np.int64)
    ends = np.cumsum(counts)
    following = np.arange(1, int(counts.sum()) + 1)
    following[ends - 1] = ends - counts
    return following


def shared_edges(counts: Integers, corners: Integers) -> SharedEdges:
    """The edges of a mesh that several sides of faces lie on.

    A side whose ends are one vertex lies on no edge.

    Parameters
    ----------
    counts, corners : integer arrays
        Number of corners of each face; vertex indices, face after face.
    """
    starts = np.asarray(corners, np.int64)
    ends = starts[next_corners(counts)]
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    size = int(high.max(initial=0)) + 1
    _, first, edge, n_sides = np.unique(
        low * size + high, return_index=True, return_inverse=True, return_counts=True
    )
    is_shared = (n_sides > 1) & (low[first] != high[first])
    in_order = np.argsort(first[is_shared])
    number = np.full(len(first), -1)
    number[np.flatnonzero(is_shared)[in_order]] = np.arange(len(in_order))
    chosen = first[is_shared][in_order]
    return SharedEdges(np.stack([low[chosen], high[chosen]], axis=1), number[edge])


def hard_flags(hard_edges: Int32s | None, edges: SharedEdges) -> npt.NDArray[np.bool_]:
    """Whether each shared edge is hard, of shape (E,).

    Parameters
    ----------
    hard_edges : int32 array of shape (H, 2) or None
        As in `Surface`.

    Raises
    ------
    InvalidInputError
        If a hard edge is not shared by two sides of faces.
    """
    if hard_edges is None:
        return np.zeros(len(edges.ends), bool)
    size = 1 + max(int(edges.ends.max(initial=0)), int(hard_edges.max(initial=0)))
    low, high = np.sort(hard_edges.astype(np.int64), axis=1).T
    wanted = low * size + high
    there = edges.ends[:, 0] * size + edges.ends[:, 1]
    is_missing = ~np.isin(wanted, there)
    if is_missing.any():
        first, second = hard_edges[int(np.argmax(is_missing))]
        raise InvalidInputError(
            f"hard edge {first}, {second} must lie between two faces or more; remove it"
        )
    return np.isin(there, wanted)


def joined_edges(edges: Sequence[Int32s | None], n_verts: Sequence[int]) -> Int32s | None:
    """The hard edges of several meshes that are one, whose vertices follow one another.

    Parameters
    ----------
    edges : sequence of int32 arrays of shape (H, 2) or None
        Of each mesh, in its own vertices.
    n_verts : sequence of int
        Of each mesh.
    """
    starts = np.cumsum([0, *n_verts], dtype=np.int64)
    found = [one + start for one, start in zip(edges, starts, strict=False) if one is not None]
    return np.concatenate(found).astype(np.int32) if found else None


def remaining_edges(
    hard_edges: Int32s | None, counts: Integers, corners: Integers
) -> Int32s | None:
    """The hard edges that two sides of these faces lie on, such as some faces of a mesh."""
    if hard_edges is None:
        return None
    edges = shared_edges(counts, corners).ends
    size = 1 + max(int(edges.max(initial=0)), int(hard_edges.max(initial=0)))
    low, high = np.sort(hard_edges.astype(np.int64), axis=1).T
    is_there = np.isin(low * size + high, edges[:, 0] * size + edges[:, 1])
    return hard_edges[is_there] if is_there.any() else None


def normal_rows(
    counts: Integers, given: Integers, hard_edges: Int32s | None, n_verts: int
) -> NormalRows:
    """The corners that share a normal, if these edges are hard.

    Parameters
    ----------
    counts, given : integer arrays
        Number of corners of each face; vertex indices, face after face.
    hard_edges : int32 array of shape (H, 2) or None

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """
    corners: Int32s = np.asarray(given, np.int32)
    every = np.arange(n_verts, dtype=np.int32)
    if hard_edges is None:
        return NormalRows(corners, every)
    edges = shared_edges(counts, corners)
    is_hard = hard_flags(hard_edges, edges)
    is_split = np.zeros(n_verts, bool)
    is_split[edges.ends[is_hard]] = True
    fan = _smooth_fans(np.asarray(counts, np.int64), corners, edges, is_hard)
    # Corners of split vertices by vertex and fan; each fan but the first gets a row of its own.
    chosen = np.flatnonzero(is_split[corners])
    _, first, number = np.unique(fan[chosen], return_index=True, return_inverse=True)
    leading = chosen[first]
    by_vertex = np.lexsort((leading, corners[leading]))
    vertices = corners[leading[by_vertex]]
    is_first = np.diff(vertices, prepend=-1) != 0
    rows = np.where(is_first, vertices, n_verts - 1 + np.cumsum(~is_first))
    of_fan = np.empty(len(leading), np.int32)
    of_fan[by_vertex] = rows
    of_corner = corners.copy()
    of_corner[chosen] = of_fan[number]
    return NormalRows(of_corner, np.concatenate([every, vertices[~is_first]]))


def _smooth_fans(
    counts: Int64s, corners: Int32s, edges: SharedEdges, is_hard: npt.NDArray[np.bool_]
) -> Int64s:
    """A number for each corner, the same for those joined at a vertex across soft edges."""
    sides = np.flatnonzero(edges.of_side >= 0)
    sides = sides[~is_hard[edges.of_side[sides]]]
    sides = sides[np.argsort(edges.of_side[sides], kind="stable")]
    following = next_corners(counts)[sides]
    is_forward = corners[sides] < corners[following]
    low, high = np.where(is_forward, (sides, following), (following, sides))
    is_same = np.flatnonzero(edges.of_side[sides][1:] == edges.of_side[sides][:-1])
    one = np.concatenate([low[is_same], high[is_same]])
    other = np.concatenate([low[is_same + 1], high[is_same + 1]])
    return joined_labels(len(corners), one, other)


def joined_labels(n_items: int, one: Int64s, other: Int64s) -> Int64s:
    """The lowest item of those that pairs of items join, of shape (n_items,).

    Parameters
    ----------
    one, other : int64 arrays of shape (N,)
        The items of each pair.
    """
    labels = np.arange(n_items)
    while True:  # each round halves the longest way to the lowest item, or so
        lowest = np.minimum(labels[one], labels[other])
        if (labels[one] == lowest).all() and (labels[other] == lowest).all():
            return labels
        np.minimum.at(labels, one, lowest)
        np.minimum.at(labels, other, lowest)
        labels = labels[labels]


class RowNormals:
    """Normals of a mesh by its hard edges, frame by frame.

    Parameters
    ----------
    counts, corners : integer arrays
        As of `shared_edges`.
    hard_edges : int32 array of shape (H, 2) or None

    Attributes
    ----------
    rows : NormalRows
    triangles : int32 array of shape (M, 3)
        The triangles of the mesh, in rows.

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """

    def __init__(
        self, counts: Integers, corners: Integers, hard_edges: Int32s | None, n_verts: int
    ) -> None:
        self.rows = normal_rows(counts, corners, hard_edges, n_verts)
        self.triangles: Int32s = triangulate_fans(counts, self.rows.of_corner)

    @classmethod
    def of_surface(cls, faces: Faces, surface: Surface, n_verts: int) -> "RowNormals":
        """Those of a mesh with this surface."""
        counts = surface.sizes(len(faces))
        return cls(counts, join_fans(counts, faces), surface.hard_edges, n_verts)

    def of_frames(self, frames: npt.NDArray[np.floating]) -> Floats:
        """Normals of the rows, of shape (T, R, 3), given positions of shape (T, V, 3)."""
        positions: npt.NDArray[np.floating] = np.ascontiguousarray(frames[:, self.rows.vertices])
        return surface_normals(positions, self.triangles)


def corner_normals(vertices: Vertices, faces: Faces, surface: Surface) -> Floats:
    """Normals of the corners of faces, smooth but across hard edges.

    Parameters
    ----------
    vertices : float array of shape (T, V, 3) or (V, 3)
        Positions of frames, or of one.
    faces : int32 array of shape (M, 3)
    surface : Surface
        Its polygons and hard edges count.

    Returns
    -------
    float64 array of shape (T, C, 3) or (C, 3)
        Of length 1, or 0 where no face has an area. C corners, face after face: 3 M without
        polygons.

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """
    frames = vertices if vertices.ndim == 3 else vertices[np.newaxis]
    shading = RowNormals.of_surface(faces, surface, frames.shape[1])
    found = shading.of_frames(frames)[:, shading.rows.of_corner]
    return found if vertices.ndim == 3 else found[0]
