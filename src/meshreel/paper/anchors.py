"""Anchor vertices, spread uniformly over a mesh."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.geometry.connectivity import neighbours_of

Integers = npt.NDArray[np.int64]


def farthest_points(adjacency: csr_array, n_points: int) -> Integers:
    """Vertices chosen one after another, each at the largest number of edges from all before.

    Connected components that hold none yet come first, so that any `n_points` of at least the
    number of components leaves none without. Ties go to the lowest vertex: the choice depends on
    connectivity alone.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Symmetric; its values do not matter.
    n_points : int
        How many; at most V.

    Returns
    -------
    Integer array of shape (n_points,), in the order of choice.

    References
    ----------
    T. F. Gonzalez, "Clustering to minimize the maximum intercluster distance", 1985.
    """
    n_verts = adjacency.shape[0]
    distance = np.full(n_verts, n_verts, np.int64)
    points = np.empty(n_points, np.int64)
    for k in range(n_points):
        points[k] = np.argmax(distance)
        _relax(adjacency, int(points[k]), distance)
    return points


def _relax(adjacency: csr_array, source: int, distance: Integers) -> None:
    """Lower `distance` to the number of edges from `source`, where that is less (in place)."""
    frontier = np.array([source])
    distance[source] = 0
    step = 0
    while frontier.size:
        step += 1
        _, reached = neighbours_of(adjacency, frontier)
        frontier = np.unique(reached[distance[reached] > step])
        distance[frontier] = step
