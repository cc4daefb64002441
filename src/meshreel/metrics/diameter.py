"""The largest distance between two points of a cloud, exactly, however flat it is."""

import numpy as np
from scipy.spatial import cKDTree

from meshreel.arrays import Floats

_SLACK = 1e-9
"""Relative margin for rounding when points are ruled out; more only costs time."""


def diameter(points: Floats) -> float:
    """Largest distance between two of the points; 0 if they all coincide.

    A first pair at distance d comes from hopping to the farthest point until that brings
    nothing. About its midpoint, ``|x - y|^2 = 2 |x|^2 + 2 |y|^2 - |x + y|^2`` shows that a
    longer pair needs ``|x|^2 + |y|^2 >= d^2 / 2``, which rules most points out. The rest search
    for their farthest partner as the nearest neighbour of x among the mirrored points -y, which
    are lifted by ``sqrt(2 max|y|^2 - 2 |y|^2)`` into a fourth dimension to account for |y|.
    Unlike a convex hull this needs no special case for planar, collinear or repeated points,
    and stays fast where every point is on the hull.

    Parameters
    ----------
    points : float64 array of shape (N, 3), N at least 1, of magnitude about 1
    """
    first, second = _distant_pair(points)
    found = float(np.linalg.norm(points[first] - points[second]))
    centred = points - (points[first] + points[second]) / 2
    squares = np.einsum("na,na->n", centred, centred)
    largest = squares.max()
    kept = squares + largest >= found**2 / 2 * (1 - _SLACK)
    centred, squares = centred[kept], squares[kept]
    lift = np.sqrt(2 * (largest - squares))
    tree = cKDTree(np.column_stack([-centred, lift]))
    reach = np.sqrt(max(4 * largest - found**2, 0) + _SLACK * largest)
    queries = np.column_stack([centred, np.zeros_like(lift)])
    partners = np.asarray(tree.query(queries, distance_upper_bound=reach)[1])
    near = partners < len(centred)  # cKDTree answers N where nothing is within reach
    pairs = centred[near] - centred[partners[near]]
    longest = np.sqrt(np.einsum("na,na->n", pairs, pairs).max(initial=0))
    return max(found, float(longest))


def _distant_pair(points: Floats) -> tuple[int, int]:
    first, second, found = 0, 0, 0.0
    while True:
        offsets = points - points[second]
        squares = np.einsum("na,na->n", offsets, offsets)
        farthest = int(squares.argmax())
        if squares[farthest] <= found:
            return first, second
        first, second, found = second, farthest, float(squares[farthest])
