"""What the core derives from connectivity: neighbours, and a hierarchy of the vertices."""

from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call
from meshreel.runtime.threads import in_background, n_cores

Integers = npt.NDArray[np.int32]
Hops = npt.NDArray[np.uint8]
Smooth = npt.NDArray[np.float32]

_Levels = tuple[Integers, Integers, Integers, npt.NDArray[np.int64]]
_Stencils = tuple[Integers, Hops, Integers]

MAX_STENCIL = 16
N_SMOOTH_FIELDS = 16
N_NEIGHBOURS = 8
MOST_SMOOTH_ROWS = 4
MAX_RESOLUTIONS = 20
MAX_LEVELS = 1 + 3 * MAX_RESOLUTIONS
"""As in `core/reel.h`."""

LEAST_APART = 4096
"""Vertices of a mesh whose smooth fields are worth a thread: levels are then found twice."""


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
    """All vertices of a mesh in coding order, and what predicts each.

    But for `order`, vertices are numbered in coding order: coarsest resolution first, level after
    level.

    Attributes
    ----------
    order : int32 array of shape (V,)
        Vertices as the faces name them, in coding order; ascending in each level.
    level_starts : int32 array of shape (L + 1,)
        Where each level begins; the last is V.
    level_resolutions : int32 array of shape (L,)
        Resolution of each level; 0 is the coarsest.
    smooth_starts : int64 array of shape (L,)
        The smooth fields of vertex v for each level are in row start + v.
    stencil : int32 array of shape (V, S)
        Lower numbers, nearest first; -1 where there are no more. Level 0 has none.
    hops : uint8 array of shape (V, S)
        How many edges of the resolution away they are; 0 where there are no more.
    contexts : int32 array of shape (V, N_NEIGHBOURS)
        Context neighbours, lower numbers too; -1 where there are no more.
    coming_smooth : Future of a float32 array of shape (rows, N_SMOOTH_FIELDS)
    """

    order: Integers
    level_starts: Integers
    level_resolutions: Integers
    smooth_starts: npt.NDArray[np.int64]
    stencil: Integers
    hops: Hops
    contexts: Integers
    coming_smooth: Future[Smooth]

    @property
    def n_verts(self) -> int:
        """V."""
        return len(self.order)

    @property
    def smooth(self) -> Smooth:
        """The smooth fields, waited for: they may be found while `order` is used already."""
        return self.coming_smooth.result()


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
    n_near = call(
        "reel_adjacency",
        faces,
        len(faces),
        n_verts,
        starts,
        near,
        what="faces",
        memory_of=("reel_adjacency_memory", n_verts, len(faces)),
    )
    return Neighbours(starts, near[:n_near].copy())


def hierarchy(found: Neighbours, stencil_size: int) -> Hierarchy:
    """The hierarchy of the vertices of a mesh, with stencils of so many vertices.

    Of a large mesh smooth fields are found in the background.

    Raises
    ------
    InvalidInputError
        If `stencil_size` is not in 1..`MAX_STENCIL`.
    """
    if len(found.starts) <= LEAST_APART or n_cores() == 1:
        levels, stencils, smooth = _hierarchy(found, stencil_size)
        coming: Future[Smooth] = Future()
        coming.set_result(smooth)
        return Hierarchy(*levels, *stencils, coming)
    coming = in_background(lambda: _hierarchy(found, stencil_size, has_stencils=False)[2])
    levels, stencils, _ = _hierarchy(found, stencil_size, has_smooth=False)
    return Hierarchy(*levels, *stencils, coming)


def _hierarchy(
    found: Neighbours, stencil_size: int, *, has_stencils: bool = True, has_smooth: bool = True
) -> tuple[_Levels, _Stencils, Smooth]:
    """The parts of a hierarchy; those that are not wanted are not filled."""
    n_verts = len(found.starts) - 1
    shape = (n_verts, max(stencil_size, 0))
    order, stencil = np.empty(n_verts, np.int32), np.empty(shape, np.int32)
    hops, contexts = np.empty(shape, np.uint8), np.empty((n_verts, N_NEIGHBOURS), np.int32)
    smooth = np.empty((MOST_SMOOTH_ROWS * n_verts, N_SMOOTH_FIELDS), np.float32)
    starts, resolutions = np.empty(MAX_LEVELS + 1, np.int32), np.empty(MAX_LEVELS, np.int32)
    smooth_starts = np.empty(MAX_LEVELS, np.int64)
    n_levels = call(
        "reel_hierarchy",
        found.starts,
        found.near,
        n_verts,
        stencil_size,
        order,
        starts,
        resolutions,
        smooth_starts,
        stencil if has_stencils else None,
        hops,
        contexts,
        smooth if has_smooth else None,
        what="stencils",
        memory_of=("reel_hierarchy_memory", n_verts, len(found.near)),
    )
    finest = smooth_starts[n_levels - 1]
    n_rows = finest + n_verts if resolutions[n_levels - 1] else 0
    levels = order, starts[: n_levels + 1], resolutions[:n_levels], smooth_starts[:n_levels]
    # What was never touched takes no memory.
    return levels, (stencil, hops, contexts), smooth[:n_rows]
