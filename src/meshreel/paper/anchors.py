"""Anchor vertices, spread uniformly over a mesh."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.geometry.connectivity import (
    adjacency_matrix,
    component_labels,
    isolated_vertices,
    neighbours_of,
)
from meshreel.runtime.profiling import staged
from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]


@staged("anchors")
def choose_anchors(faces: Faces, n_verts: int, share: float) -> Integers:
    """Anchors spread uniformly over the mesh, ascending: a share of the vertices that have edges.

    Every component with an edge gets at least one, whatever the share.
    """
    n_components, _ = component_labels(faces, n_verts)
    isolated = isolated_vertices(faces, n_verts)
    connected = np.setdiff1d(np.arange(n_verts), isolated, assume_unique=True)
    n_anchors = max(n_components - len(isolated), int(np.ceil(share * len(connected))))
    adjacency = adjacency_matrix(faces, n_verts)[connected][:, connected]
    return np.sort(connected[farthest_points(csr_array(adjacency), n_anchors)])


def farthest_points(adjacency: csr_array, n_points: int) -> Integers:
    """Farthest-point samples: each the most edges away from all samples before it.

    Connected components without a sample come first, so that each has one if `n_points` is at least
    the number of components. Ties go to the lowest vertex: the samples depend on connectivity
    alone.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Symmetric; its values do not matter.
    n_points : int
        Number of samples; at most V.

    Returns
    -------
    Integer array of shape (n_points,), in sampling order.

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
    """Lower `distance` in place to the number of edges from `source`, where that is less."""
    frontier = np.array([source])
    distance[source] = 0
    n_edges = 0
    while frontier.size:
        n_edges += 1
        _, reached = neighbours_of(adjacency, frontier)
        frontier = np.unique(reached[distance[reached] > n_edges])
        distance[frontier] = n_edges
