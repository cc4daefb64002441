"""Exact diameter of a point cloud, also of flat ones."""

import numpy as np
from scipy.spatial import cKDTree

from meshreel.arrays import Floats

_SLACK = 1e-9
"""Relative margin for rounding when points are excluded; larger values only cost time."""


def diameter(points: Floats) -> float:
    """Largest distance between two of the points; 0 if they all coincide.

    Repeated jumps to the farthest point give a first pair at distance d. About its midpoint,
    ``|x - y|^2 = 2 |x|^2 + 2 |y|^2 - |x + y|^2`` shows that a longer pair needs
    ``|x|^2 + |y|^2 >= d^2 / 2``, which excludes most points. The farthest partner of each other
    point x is its nearest neighbor among the mirrored points -y, lifted by
    ``sqrt(2 max|y|^2 - 2 |y|^2)`` into a fourth dimension to account for |y|. Unlike a convex hull
    this needs no special case for planar, collinear or repeated points, and stays fast if every
    point is on the hull.

    Parameters
    ----------
    points : float64 array of shape (N, 3), N at least 1, with coordinates of magnitude about 1
    """
    first, second = _distant_pair(points)
    distance = float(np.linalg.norm(points[first] - points[second]))
    centered = points - (points[first] + points[second]) / 2
    squares = np.einsum("na,na->n", centered, centered)
    largest = squares.max()
    is_candidate = squares + largest >= distance**2 / 2 * (1 - _SLACK)
    centered, squares = centered[is_candidate], squares[is_candidate]
    lift = np.sqrt(2 * (largest - squares))
    tree = cKDTree(np.column_stack([-centered, lift]))
    reach = np.sqrt(max(4 * largest - distance**2, 0) + _SLACK * largest)
    queries = np.column_stack([centered, np.zeros_like(lift)])
    partners = np.asarray(tree.query(queries, distance_upper_bound=reach)[1])
    near = partners < len(centered)  # cKDTree returns N if nothing is within reach
    pairs = centered[near] - centered[partners[near]]
    longest = np.sqrt(np.einsum("na,na->n", pairs, pairs).max(initial=0))
    return max(distance, float(longest))


def _distant_pair(points: Floats) -> tuple[int, int]:
    first, second, largest = 0, 0, 0.0
    while True:
        offsets = points - points[second]
        squares = np.einsum("na,na->n", offsets, offsets)
        farthest = int(squares.argmax())
        if squares[farthest] <= largest:
            return first, second
        first, second, largest = second, farthest, float(squares[farthest])
