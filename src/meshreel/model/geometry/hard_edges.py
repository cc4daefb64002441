"""Hard edges, across which faces do not share normals, and the resulting normals.

At a vertex, faces connected across soft edges share one normal, their area-weighted mean. Without
a hard edge that is the vertex normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import surface_normals
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.geometry.connectivity import lowest_connected
from meshreel.model.geometry.polygons import Integers, join_triangles
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Surface

Int64s = npt.NDArray[np.int64]
Int32s = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SharedEdges:
    """Edges with at least two face sides, in the order of their first sides."""

    ends: Int64s
    """int64 array of shape (E, 2). Vertices of each edge, the lower first."""
    of_side: Int64s
    """int64 array of shape (C,). The edge from each corner to the next corner of its face; -1 if it
    is not shared.
    """


@dataclass(frozen=True, eq=False)
class NormalRows:
    """Sharing of normals by face corners: each row is one normal."""

    of_corner: Int32s
    """int32 array of shape (C,). The row of each corner. The first corner of vertex v has row v."""
    vertices: Int32s
    """int32 array of shape (R,). The vertex of each row; R is V without hard edges."""


def next_corners(counts: Integers) -> Int64s:
    """The next corner of the same face, cyclically, for each corner, of shape (C,)."""
    counts = np.asarray(counts, np.int64)
    ends = np.cumsum(counts)
    next_corner = np.arange(1, int(counts.sum()) + 1)
    next_corner[ends - 1] = ends - counts
    return next_corner


def shared_edges(counts: Integers, corners: Integers) -> SharedEdges:
    """The edges shared by several face sides; a side with equal ends has no edge.

    Parameters
    ----------
    counts, corners : integer arrays
        Number of corners of each face; concatenated vertex indices of all faces.
    """
    starts = np.asarray(corners, np.int64)
    ends = starts[next_corners(counts)]
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    size = int(high.max(initial=0)) + 1
    _, first, edge, n_sides = np.unique(
        low * size + high, return_index=True, return_inverse=True, return_counts=True
    )
    is_shared = (n_sides > 1) & (low[first] != high[first])
    order = np.argsort(first[is_shared])
    number = np.full(len(first), -1)
    number[np.flatnonzero(is_shared)[order]] = np.arange(len(order))
    first_sides = first[is_shared][order]
    return SharedEdges(np.stack([low[first_sides], high[first_sides]], axis=1), number[edge])


def hard_flags(hard_edges: Int32s | None, edges: SharedEdges) -> npt.NDArray[np.bool_]:
    """Whether each shared edge is hard, of shape (E,).

    Parameters
    ----------
    hard_edges : int32 array of shape (H, 2) or None
        As in `Surface`.

    Raises
    ------
    InvalidInputError
        If a hard edge is not shared by two face sides.
    """
    if hard_edges is None:
        return np.zeros(len(edges.ends), bool)
    hard_keys, keys = _edge_keys(hard_edges, edges.ends)
    is_missing = ~np.isin(hard_keys, keys)
    if is_missing.any():
        first, second = hard_edges[int(np.argmax(is_missing))]
        raise InvalidInputError(
            f"hard edge {first}, {second} must have two or more faces; remove it"
        )
    return np.isin(keys, hard_keys)


def _edge_keys(hard_edges: Int32s, ends: Int64s) -> tuple[Int64s, Int64s]:
    """Comparable keys of hard edges and of other edges, whose lower vertex is first."""
    size = 1 + max(int(ends.max(initial=0)), int(hard_edges.max(initial=0)))
    low, high = np.sort(hard_edges.astype(np.int64), axis=1).T
    return low * size + high, ends[:, 0] * size + ends[:, 1]


def merged_edges(edges: Sequence[Int32s | None], n_verts: Sequence[int]) -> Int32s | None:
    """The hard edges of several meshes, renumbered for the mesh that concatenates their vertices.

    Parameters
    ----------
    edges : sequence of int32 arrays of shape (H, 2) or None
        Hard edges of each mesh.
    n_verts : sequence of int
        Number of vertices of each mesh.
    """
    starts = np.cumsum([0, *n_verts], dtype=np.int64)
    merged = [
        pairs + start for pairs, start in zip(edges, starts, strict=False) if pairs is not None
    ]
    return np.concatenate(merged).astype(np.int32) if merged else None


def remaining_edges(
    hard_edges: Int32s | None, counts: Integers, corners: Integers
) -> Int32s | None:
    """The hard edges that these faces share, such as the remaining faces of a mesh."""
    if hard_edges is None:
        return None
    hard_keys, keys = _edge_keys(hard_edges, shared_edges(counts, corners).ends)
    is_shared = np.isin(hard_keys, keys)
    return hard_edges[is_shared] if is_shared.any() else None


def normal_rows(
    counts: Integers, corner_vertices: Integers, hard_edges: Int32s | None, n_verts: int
) -> NormalRows:
    """Assign corners to rows of shared normals.

    Parameters
    ----------
    counts, corner_vertices : integer arrays
        Number of corners of each face; concatenated vertex indices of all faces.
    hard_edges : int32 array of shape (H, 2) or None

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """
    corners: Int32s = np.asarray(corner_vertices, np.int32)
    all_vertices = np.arange(n_verts, dtype=np.int32)
    if hard_edges is None:
        return NormalRows(corners, all_vertices)
    edges = shared_edges(counts, corners)
    is_hard = hard_flags(hard_edges, edges)
    is_split = np.zeros(n_verts, bool)
    is_split[edges.ends[is_hard]] = True
    fan = _smooth_fans(np.asarray(counts, np.int64), corners, edges, is_hard)
    # Corners of split vertices by vertex and fan; each fan but the first gets a new row.
    split_corners = np.flatnonzero(is_split[corners])
    _, first, number = np.unique(fan[split_corners], return_index=True, return_inverse=True)
    first_corners = split_corners[first]
    by_vertex = np.lexsort((first_corners, corners[first_corners]))
    vertices = corners[first_corners[by_vertex]]
    is_first = np.diff(vertices, prepend=-1) != 0
    rows = np.where(is_first, vertices, n_verts - 1 + np.cumsum(~is_first))
    of_fan = np.empty(len(first_corners), np.int32)
    of_fan[by_vertex] = rows
    of_corner = corners.copy()
    of_corner[split_corners] = of_fan[number]
    return NormalRows(of_corner, np.concatenate([all_vertices, vertices[~is_first]]))


def _smooth_fans(
    counts: Int64s, corners: Int32s, edges: SharedEdges, is_hard: npt.NDArray[np.bool_]
) -> Int64s:
    """A label for each corner, equal for corners of a vertex connected across soft edges."""
    sides = np.flatnonzero(edges.of_side >= 0)
    sides = sides[~is_hard[edges.of_side[sides]]]
    sides = sides[np.argsort(edges.of_side[sides], kind="stable")]
    ends = next_corners(counts)[sides]
    is_forward = corners[sides] < corners[ends]
    low, high = np.where(is_forward, (sides, ends), (ends, sides))
    is_same = np.flatnonzero(edges.of_side[sides][1:] == edges.of_side[sides][:-1])
    first = np.concatenate([low[is_same], high[is_same]])
    second = np.concatenate([low[is_same + 1], high[is_same + 1]])
    return lowest_connected(len(corners), first, second)


class RowNormals:
    """Computes the normals of a mesh with hard edges.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    counts : integer array
        Number of corners of each polygon.
    hard_edges : int32 array of shape (H, 2) or None

    Attributes
    ----------
    rows : NormalRows
    triangles : int32 array of shape (M, 3)
        The triangles of the mesh, as row indices.

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """

    def __init__(
        self, faces: Faces, counts: Integers, hard_edges: Int32s | None, n_verts: int
    ) -> None:
        corners = join_triangles(counts, faces)
        self.rows: NormalRows = normal_rows(counts, corners, hard_edges, n_verts)
        self.triangles: Int32s = self.rows.of_corner[triangle_corners(counts, faces)]

    @classmethod
    def of_surface(cls, faces: Faces, surface: Surface, n_verts: int) -> "RowNormals":
        """The normals of a mesh with this surface."""
        return cls(faces, surface.sizes(len(faces)), surface.hard_edges, n_verts)

    def of_frames(self, frames: npt.NDArray[np.floating]) -> Floats:
        """Normals of the rows, of shape (T, R, 3), from positions of shape (T, V, 3)."""
        positions: npt.NDArray[np.floating] = np.ascontiguousarray(frames[:, self.rows.vertices])
        return surface_normals(positions, self.triangles)


def corner_normals(vertices: Vertices, faces: Faces, surface: Surface) -> Floats:
    """Normals of face corners, smooth except across hard edges.

    Parameters
    ----------
    vertices : float array of shape (T, V, 3) or (V, 3)
        Positions of several frames, or of one.
    faces : int32 array of shape (M, 3)
    surface : Surface
        Provides polygons and hard edges.

    Returns
    -------
    float64 array of shape (T, C, 3) or (C, 3)
        Unit vectors, or 0 where all faces are degenerate. C is the number of corners of all faces,
        3 M without polygons.

    Raises
    ------
    InvalidInputError
        As `hard_flags`.
    """
    frames = vertices if vertices.ndim == 3 else vertices[np.newaxis]
    shading = RowNormals.of_surface(faces, surface, frames.shape[1])
    normals = shading.of_frames(frames)[:, shading.rows.of_corner]
    return normals if vertices.ndim == 3 else normals[0]
