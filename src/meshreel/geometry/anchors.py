"""Anchor vertices, spread uniformly over a mesh."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

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


def nested_anchors(
    adjacency: csr_array, labels: Integers, spacings: Sequence[int], least: int
) -> list[Integers]:
    """Sets of vertices that grow denser: each adds what keeps a smaller distance from all before.

    A set is maximal: every vertex lies nearer than the spacing to one of this or an earlier set.
    Of components that would get fewer than `least` vertices in the first set, smaller spacings
    are tried in turn. Everything is integer arithmetic on connectivity, so that encoder and
    decoder find the same sets.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Symmetric; its values do not matter.
    labels : integer array of shape (V,)
        Component of each vertex.
    spacings : sequence of int
        In edges, falling, at least 1.
    least : int
        Vertices that each component gets in the first set, or all it has.

    Returns
    -------
    list of integer arrays, one for each spacing, ascending, disjoint

    References
    ----------
    M. Luby, "A simple parallel algorithm for the maximal independent set problem", 1986.
    """
    ranks = _scattered_ranks(adjacency.shape[0])
    wanted = np.minimum(np.bincount(labels), least)
    first = np.zeros(0, np.int64)
    for spacing in range(spacings[0], 0, -1):
        served = np.bincount(labels[first], minlength=len(wanted)) >= wanted
        if served.all():
            break
        added = _spread(adjacency, first, spacing, ranks)
        first = np.concatenate([first, added[~served[labels[added]]]])
    sets = [np.sort(first)]
    for spacing in spacings[1:]:
        sets.append(np.sort(_spread(adjacency, np.concatenate(sets), spacing, ranks)))
    return sets


def _spread(adjacency: csr_array, known: Integers, spacing: int, ranks: Integers) -> Integers:
    """Vertices at least `spacing` edges from the known ones and each other, as many as fit."""
    free = _is_far(adjacency, known, spacing)
    found = []
    while free.any():
        candidates = np.where(free, ranks, -1)
        highest = candidates
        for _ in range(spacing - 1):
            highest = _highest_around(adjacency, highest)
        chosen = np.flatnonzero(free & (candidates == highest))
        found.append(chosen)
        free &= _is_far(adjacency, chosen, spacing)
    return np.concatenate([np.zeros(0, np.int64), *found])


def _is_far(adjacency: csr_array, sources: Integers, spacing: int) -> npt.NDArray[np.bool_]:
    """Whether each vertex is at least `spacing` edges from all sources."""
    near = np.zeros(adjacency.shape[0], np.int64)
    near[sources] = 1
    for _ in range(spacing - 1):
        near = _highest_around(adjacency, near)
    return np.asarray(near == 0)


def _highest_around(adjacency: csr_array, values: Integers) -> Integers:
    """The highest value of each vertex and its neighbours."""
    starts, degrees = adjacency.indptr[:-1], np.diff(adjacency.indptr)
    connected = degrees > 0
    highest = values.copy()
    if connected.any():
        around = np.maximum.reduceat(values[adjacency.indices], starts[connected])
        highest[connected] = np.maximum(highest[connected], around)
    return highest


def _scattered_ranks(n_verts: int) -> Integers:
    """Distinct numbers 0..V-1 that show no order: those of a multiplicative hash, ranked."""
    mixed = np.arange(n_verts, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= mixed >> np.uint64(31)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    ranks = np.empty(n_verts, np.int64)
    ranks[np.argsort(mixed, kind="stable")] = np.arange(n_verts)
    return ranks


def _relax(adjacency: csr_array, source: int, distance: Integers) -> None:
    """Lower `distance` to the number of edges from `source`, where that is less (in place)."""
    frontier = np.array([source])
    distance[source] = 0
    step = 0
    while frontier.size:
        step += 1
        reached = _neighbours(adjacency, frontier)
        frontier = np.unique(reached[distance[reached] > step])
        distance[frontier] = step


def _neighbours(adjacency: csr_array, vertices: Integers) -> Integers:
    starts, ends = adjacency.indptr[vertices], adjacency.indptr[vertices + 1]
    counts = ends - starts
    before = np.cumsum(counts) - counts
    positions = np.arange(counts.sum()) + np.repeat(starts - before, counts)
    return np.asarray(adjacency.indices[positions], np.int64)
