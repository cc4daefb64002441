"""What the core derives from connectivity: neighbours, and a hierarchy of the vertices."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call, memory, size_of

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int32]
Hops = npt.NDArray[np.uint8]

MAX_STENCIL = 16
MAX_RESOLUTIONS = 20
MAX_LEVELS = 1 + 3 * MAX_RESOLUTIONS
"""As in `core/reel.h`."""


@dataclass(frozen=True)
class Neighbours:
    """Which vertices of a mesh are next to each other.

    Attributes
    ----------
    starts : int32 array of shape (V + 1,)
    near : int32 array
        Those next to v are near[starts[v] : starts[v + 1]], ascending, each once.
    """

    starts: Integers
    near: Integers


@dataclass(frozen=True)
class Hierarchy:
    """All vertices of a mesh level after level, and the stencils that predict them.

    Attributes
    ----------
    order : int32 array of shape (V,)
        Vertices, level after level, ascending in each.
    level_starts : int32 array of shape (L + 1,)
        Where each level begins in `order`; the last is V.
    level_resolutions : int32 array of shape (L,)
        Resolution of each level; 0 is the coarsest.
    stencil : int32 array of shape (V, S)
        For each vertex in order those that predict it, nearest first; -1 where there are no more.
    hops : uint8 array of shape (V, S)
        How many edges of the resolution away they are; 0 where there are no more.
    weights : float64 array of shape (V, S)
        Those that smooth fields suggest; rows sum to 1, or to 0 where the stencil is empty.
    """

    order: Integers
    level_starts: Integers
    level_resolutions: Integers
    stencil: Integers
    hops: Hops
    weights: Floats


def neighbours(faces: npt.NDArray[np.integer], n_verts: int) -> Neighbours:
    """The neighbours of every vertex; faces may be degenerate, and name an edge often.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
        V.

    Raises
    ------
    InvalidInputError
        If a face names a vertex that is not there.
    """
    faces = np.ascontiguousarray(faces, np.int32)
    starts, near = np.empty(n_verts + 1, np.int32), np.empty(2 * faces.size, np.int32)
    room = memory(size_of("reel_adjacency_memory", n_verts, len(faces)))
    n_near = call(
        "reel_adjacency", room, len(room), faces, len(faces), n_verts, starts, near, what="faces"
    )
    return Neighbours(starts, near[:n_near].copy())


def hierarchy(found: Neighbours, stencil_size: int) -> Hierarchy:
    """The hierarchy of the vertices of a mesh, with stencils of so many vertices.

    Raises
    ------
    InvalidInputError
        If `stencil_size` is not in 1..`MAX_STENCIL`.
    """
    n_verts = len(found.starts) - 1
    shape = (n_verts, max(stencil_size, 0))
    order, stencil = np.empty(n_verts, np.int32), np.empty(shape, np.int32)
    hops, weights = np.empty(shape, np.uint8), np.empty(shape, np.float64)
    starts, resolutions = np.empty(MAX_LEVELS + 1, np.int32), np.empty(MAX_LEVELS, np.int32)
    room = memory(size_of("reel_hierarchy_memory", n_verts, len(found.near), 1))
    n_levels = call(
        "reel_hierarchy",
        room,
        len(room),
        found.starts,
        found.near,
        n_verts,
        stencil_size,
        order,
        starts,
        resolutions,
        stencil,
        hops,
        weights,
        what="stencils",
    )
    return Hierarchy(order, starts[: n_levels + 1], resolutions[:n_levels], stencil, hops, weights)
