"""Neighbors and hierarchy of the vertices of a mesh, by the core."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call, int32s
from meshreel.kernel.order import opposite_sides

Integers = npt.NDArray[np.int32]
Hops = npt.NDArray[np.uint8]
Smooth = npt.NDArray[np.float32]

N_SMOOTH_FIELDS = 16
N_NEIGHBORS = 8
MAX_SMOOTH_ROWS = 4
MAX_RESOLUTIONS = 20
MAX_LEVELS = 1 + 3 * MAX_RESOLUTIONS
"""REEL_MAX_LEVELS of `core/reel.h`."""


@dataclass(frozen=True)
class Neighbors:
    """Adjacency lists of a mesh."""

    starts: Integers
    """int32 array of shape (V + 1,)."""
    near: Integers
    """int32 array. The neighbors of v are near[starts[v] : starts[v + 1]], ascending and unique."""


@dataclass(frozen=True)
class Hierarchy:
    """The vertices of a mesh in coding order, with their prediction stencils.

    Vertices are numbered in coding order, level by level from the coarsest resolution, except in
    the values of `order`.
    """

    order: Integers
    """int32 array of shape (V,). Vertex index in the faces for each number; ascending in each
    level.
    """
    level_starts: Integers
    """int32 array of shape (L + 1,). First number of each level, then V."""
    level_resolutions: Integers
    """int32 array of shape (L,). Resolution of each level; 0 is the coarsest."""
    smooth_starts: npt.NDArray[np.int64]
    """int64 array of shape (L,). The smooth fields of vertex v for each level are in row start + v.
    """
    stencil: Integers
    """int32 array of shape (V, S). Lower numbers, nearest first, padded with -1. Level 0 has none.
    """
    hops: Hops
    """uint8 array of shape (V, S). Distances to them, in edges of the resolution, padded with 0."""
    contexts: Integers
    """int32 array of shape (V, N_NEIGHBORS). Context neighbors, with lower numbers, padded with -1.
    """
    smooth: Smooth
    """float32 array of shape (rows, N_SMOOTH_FIELDS)."""

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return len(self.order)


def neighbors(faces: npt.NDArray[np.integer], n_verts: int) -> Neighbors:
    """The neighbors of every vertex; faces may be degenerate, and edges repeated.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
        V.

    Raises
    ------
    InvalidInputError
        If a face contains a vertex that does not exist.
    """
    faces = int32s(faces)
    starts, near = np.empty(n_verts + 1, np.int32), np.empty(2 * faces.size, np.int32)
    n_near = call(
        "reel_adjacency",
        faces,
        len(faces),
        n_verts,
        starts,
        near,
        noun="faces",
        memory_of=("reel_adjacency_memory", n_verts, len(faces)),
    )
    return Neighbors(starts, near[:n_near].copy())


def item_faces(
    faces: npt.NDArray[np.integer], n_verts: int, items: npt.NDArray[np.integer]
) -> Integers:
    """Return the faces of a graph of items at the corners of a mesh, for `neighbors`.

    Items are adjacent within a face, and across an edge at the same vertex.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    items : integer array of shape (M, 3)
        The item at each corner of a face.
    """
    twins = opposite_sides(faces, n_verts)
    triangles = np.empty((4 * len(faces), 3), np.int32)
    arguments = int32s(faces), twins, int32s(items), len(faces), triangles
    return triangles[: call("reel_item_faces", *arguments, noun="faces")].copy()


def hierarchy(graph: Neighbors, stencil_size: int) -> Hierarchy:
    """The hierarchy of the vertices of a mesh, with stencils of up to `stencil_size` vertices.

    Raises
    ------
    InvalidInputError
        If `stencil_size` is not in 1..16.
    """
    n_verts = len(graph.starts) - 1
    shape = (n_verts, max(stencil_size, 0))
    order, stencil = np.empty(n_verts, np.int32), np.empty(shape, np.int32)
    hops, contexts = np.empty(shape, np.uint8), np.empty((n_verts, N_NEIGHBORS), np.int32)
    smooth = np.empty((MAX_SMOOTH_ROWS * n_verts, N_SMOOTH_FIELDS), np.float32)
    starts, resolutions = np.empty(MAX_LEVELS + 1, np.int32), np.empty(MAX_LEVELS, np.int32)
    smooth_starts = np.empty(MAX_LEVELS, np.int64)
    n_levels = call(
        "reel_hierarchy",
        graph.starts,
        graph.near,
        n_verts,
        stencil_size,
        order,
        starts,
        resolutions,
        smooth_starts,
        stencil,
        hops,
        contexts,
        smooth,
        noun="stencils",
        memory_of=("reel_hierarchy_memory", n_verts, len(graph.near), 1),
    )
    finest = smooth_starts[n_levels - 1]
    n_rows = finest + n_verts if resolutions[n_levels - 1] else 0
    return Hierarchy(
        order,
        starts[: n_levels + 1],
        resolutions[:n_levels],
        smooth_starts[:n_levels],
        stencil,
        hops,
        contexts,
        # Pages of this array that were never written take no memory.
        smooth[:n_rows],
    )
