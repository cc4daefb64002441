"""Anchor vertices: farthest-point samples, a random subset, or listed by the user."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from meshreel.arrays import Integers
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.connectivity import component_labels, isolated_vertices
from meshreel.model.sequence import Faces
from meshreel.paper.laplacian import adjacency_matrix, neighbors_of


def choose_anchors(
    faces: Faces, n_verts: int, share: float, rng: np.random.Generator | None = None
) -> Integers:
    """Choose a share of the vertices that have edges as anchors, in ascending order.

    Every component with an edge gets at least one.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
    share : float
        0..1.
    rng : Generator, optional
        Selects a random subset. Default: farthest-point samples.

    Returns
    -------
    int64 array of shape (A,), ascending
    """
    n_components = int(component_labels(faces, n_verts).max()) + 1
    isolated = isolated_vertices(faces, n_verts)
    connected = np.setdiff1d(np.arange(n_verts), isolated, assume_unique=True)
    n_anchors = max(n_components - len(isolated), int(np.ceil(share * len(connected))))
    if rng is not None:
        return _first_of_components(rng.permutation(connected), faces, n_verts, n_anchors)
    adjacency = adjacency_matrix(faces, n_verts)[connected][:, connected]
    return np.sort(connected[farthest_points(csr_array(adjacency), n_anchors)])


def _first_of_components(ranked: Integers, faces: Faces, n_verts: int, n_anchors: int) -> Integers:
    """Return the first vertex of each component in a ranking, and the first of all others.

    Parameters
    ----------
    ranked : integer array
        All vertices with an edge, the best first.
    n_anchors : int
        At least the number of components with an edge.

    Returns
    -------
    int64 array of shape (n_anchors,), ascending
    """
    labels = component_labels(faces, n_verts)
    _, first = np.unique(labels[ranked], return_index=True)
    others = np.delete(ranked, first)
    return np.sort(np.concatenate([ranked[first], others[: n_anchors - len(first)]]))


def check_anchors(anchors: Sequence[int], faces: Faces, n_verts: int) -> Integers:
    """Validate anchors listed by the user, and return them in ascending order.

    Raises
    ------
    InvalidInputError
        If one is not a vertex, is repeated or has no edge, or a component has none.
    """
    vertices = np.array(sorted(anchors), np.int64)
    if len(vertices) == 0 or vertices[0] < 0 or vertices[-1] >= n_verts:
        raise InvalidInputError(
            f"anchors must be vertices 0..{n_verts - 1}, at least one; got {list(anchors)[:5]}"
        )
    if np.any(np.diff(vertices) == 0):
        repeated = vertices[1:][np.diff(vertices) == 0][0]
        raise InvalidInputError(f"anchors lists vertex {repeated} twice; list it once")
    isolated = isolated_vertices(faces, n_verts)
    without_edge = np.intersect1d(vertices, isolated)
    if len(without_edge):
        raise InvalidInputError(
            f"vertex {without_edge[0]} has no edge and cannot be an anchor; leave it out"
        )
    labels = component_labels(faces, n_verts)
    missing = np.setdiff1d(labels, np.concatenate([labels[vertices], labels[isolated]]))
    if len(missing):
        vertex = int(np.flatnonzero(labels == missing[0])[0])
        raise InvalidInputError(
            f"{len(missing)} connected components have no anchor, for example the component of "
            f"vertex {vertex}; list a vertex of each"
        )
    return vertices


def farthest_points(adjacency: csr_array, n_points: int) -> Integers:
    """Return farthest-point samples: each maximizes the edge distance to all previous samples.

    Connected components without a sample come first, so that each has one if `n_points` is at least
    the number of components. Ties go to the lowest vertex, so the samples depend on connectivity
    alone.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Symmetric; its values are ignored.
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
    """Lower `distance` in place to the edge distance from `source` by breadth-first search."""
    frontier = np.array([source])
    distance[source] = 0
    n_edges = 0
    while frontier.size:
        n_edges += 1
        _, reached = neighbors_of(adjacency, frontier)
        frontier = np.unique(reached[distance[reached] > n_edges])
        distance[frontier] = n_edges
