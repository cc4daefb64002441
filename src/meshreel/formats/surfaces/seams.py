"""Welding of surfaces that files split along the seams of textures and normals."""

import numpy as np

from meshreel.formats.surfaces.welding import Numbers, SplitMesh, weld_rows
from meshreel.model.sequence import Vertices


def weld_seams(points: Vertices, triangles: Numbers) -> SplitMesh:
    """Weld points along the seams of a surface, where pairs of open edges coincide.

    Two edges of one triangle each are joined if they connect equal positions in opposite
    directions, and no other open edge connects these. Equal positions elsewhere stay apart: with
    coarsely rounded positions, welding them would collapse triangles and connect sheets that touch.

    Parameters
    ----------
    points : float array of shape (N, 3)
        Without negative zeros.
    triangles : int64 array of shape (M, 3)
        Indices in 0..N-1.
    """
    n_points, starts, ends = len(points), triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    sides, opposite = starts * n_points + ends, np.sort(ends * n_points + starts)
    # np.isin hashes, which takes ten times as long.
    nearest = opposite.take(np.searchsorted(opposite, sides), mode="clip")
    open_sides = np.flatnonzero(nearest != sides)
    starts, ends = starts[open_sides], ends[open_sides]
    place, _ = weld_rows([points])
    low, high = np.sort([place[starts], place[ends]], axis=0)
    _, seams, counts = np.unique(low * n_points + high, return_inverse=True, return_counts=True)
    is_pair = (counts == 2)[seams] & (low < high)
    pairs = np.flatnonzero(is_pair)[np.argsort(seams[is_pair], kind="stable")].reshape(-1, 2)
    are_opposite = place[starts[pairs[:, 0]]] == place[ends[pairs[:, 1]]]
    # Two sides of a triangle coincide if its third has no length.
    are_apart = open_sides[pairs[:, 0]] // 3 != open_sides[pairs[:, 1]] // 3
    one, other = pairs[are_opposite & are_apart].T
    links = np.concatenate([[starts[one], ends[other]], [ends[one], starts[other]]], axis=1)
    vertex_of, first = weld_rows([_lowest_linked(links, n_points)[:, np.newaxis]])
    return SplitMesh(vertex_of, first, triangles.ravel())


def _lowest_linked(links: Numbers, n_points: int) -> Numbers:
    """The lowest of all points that each point is linked to, directly or through others.

    Parameters
    ----------
    links : int64 array of shape (2, L)
        Pairs of points.
    """
    lowest = np.arange(n_points)
    while (lowest[links[0]] != lowest[links[1]]).any():
        roots, others = lowest[links]
        np.minimum.at(lowest, np.maximum(roots, others), np.minimum(roots, others))
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
    return lowest
