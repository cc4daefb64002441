"""Closest points on triangles, exact and without any library but SciPy."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.runtime.extras import SURFACES

Indices = npt.NDArray[np.intp]

FANOUT = 4
"""Children of each node of the tree of boxes."""

PACKET = 8
"""Neighboring points whose common box descends the tree of boxes."""

POINTS_AT_ONCE = 1 << 14

MAX_PAIRS = 1 << 22
"""Largest number of pairs of packet and node in memory; with more, the points are halved."""


def k_d_tree(points: Floats, **options: Any) -> Any:
    """Return SciPy's k-d tree of the points.

    Raises
    ------
    InvalidInputError
        If SciPy, the extra [surfaces], is not installed.
    """
    return SURFACES.load("spatial").cKDTree(points, **options)


class ClosestPoints(NamedTuple):
    """Closest points of N points.

    Attributes
    ----------
    squared_distances : float64 array of shape (N,)
    triangles : integer array of shape (N,)
        The triangle that contains the closest point; one of several where they meet.
    points : float64 array of shape (N, 3)
    """

    squared_distances: Floats
    triangles: Indices
    points: Floats


class TriangleTree:
    """A set of triangles, prepared for many searches of closest points.

    The search is exact up to rounding. The triangles of the two nearest centroids bound the
    distance of each point. A tree of bounding boxes then yields all triangles that may be closer,
    for `PACKET` neighboring points at a time, so that NumPy works on long arrays. The nodes are
    runs of triangles in the order of a k-d tree of the centroids.

    Parameters
    ----------
    corners : float64 array of shape (M, 3, 3)
        Corners of at least one triangle, finite, about 1 in size. Triangles without area are
        allowed.
    """

    def __init__(self, corners: Floats) -> None:
        self._origins = corners[:, 0]
        self._edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        self._gram = tuple(
            _dots(self._edges[i], self._edges[j]) for i, j in ((0, 0), (0, 1), (1, 1))
        )
        self._duals = _dual_edges(*self._edges)
        self._centroids = k_d_tree(corners.mean(axis=1))
        self._order: Indices = self._centroids.indices
        low, high = corners.min(axis=1)[self._order], corners.max(axis=1)[self._order]
        self._boxes = [(low, high)]
        while len(low) > FANOUT * FANOUT:
            starts = np.arange(0, len(low), FANOUT)
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            self._boxes.append((low, high))

    def closest(self, points: Floats) -> ClosestPoints:
        """Return the closest point of all triangles for each point of shape (N, 3), float64."""
        if not len(points):
            return ClosestPoints(np.empty(0), np.empty(0, np.intp), np.empty((0, 3)))
        # Packets are neighbors in this order.
        order = k_d_tree(points, leafsize=PACKET, compact_nodes=False).indices
        parts = [
            self._closest(points[order[start : start + POINTS_AT_ONCE]])
            for start in range(0, len(points), POINTS_AT_ONCE)
        ]
        place = np.empty(len(points), np.intp)
        place[order] = np.arange(len(points))
        squared, triangles, found = (
            np.concatenate(part)[place] for part in zip(*parts, strict=True)
        )
        return ClosestPoints(squared, triangles, found)

    def _closest(self, points: Floats) -> ClosestPoints:
        best = self._near_centroids(points)
        rows, triangles = self._candidates(points, best.squared_distances)
        is_new = triangles != best.triangles[rows]
        rows, triangles = rows[is_new], triangles[is_new]
        found = self._on_triangles(points[rows], triangles)
        least = best.squared_distances.copy()
        np.minimum.at(least, rows, found.squared_distances)
        is_closer = found.squared_distances < best.squared_distances[rows]
        wins = np.flatnonzero(is_closer & (found.squared_distances == least[rows]))
        for values, others in zip(best, found, strict=True):
            values[rows[wins]] = others[wins]
        return best

    def _near_centroids(self, points: Floats) -> ClosestPoints:
        """Return the closest points on the triangles of the two nearest centroids."""
        _, nearest = self._centroids.query(points, min(2, len(self._order)))
        nearest = nearest.reshape(len(points), -1)
        best = self._on_triangles(points, nearest[:, 0])
        for column in nearest.T[1:]:
            found = self._on_triangles(points, column)
            closer = found.squared_distances < best.squared_distances
            for values, others in zip(best, found, strict=True):
                values[closer] = others[closer]
        return best

    def _candidates(self, points: Floats, squared: Floats) -> tuple[Indices, Indices]:
        """Return pairs of point and triangle whose box is closer than a squared distance."""
        starts = np.arange(0, len(points), PACKET)
        lows, highs = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
        most = np.maximum.reduceat(squared, starts)
        n_top = len(self._boxes[-1][0])
        packets, nodes = (
            np.repeat(np.arange(len(starts)), n_top),
            np.tile(np.arange(n_top), len(starts)),
        )
        for level, (low, high) in reversed(list(enumerate(self._boxes))):
            gaps = np.maximum(low[nodes] - highs[packets], lows[packets] - high[nodes])
            near = _squares_of_positive(gaps) < most[packets]
            packets, nodes = packets[near], nodes[near]
            if len(packets) * PACKET > MAX_PAIRS and len(points) > PACKET:
                return self._candidates_of_halves(points, squared)
            if level:
                packets = np.repeat(packets, FANOUT)
                nodes = (nodes[:, None] * FANOUT + np.arange(FANOUT)).ravel()
                exists = nodes < len(self._boxes[level - 1][0])
                packets, nodes = packets[exists], nodes[exists]
        rows = (packets[:, None] * PACKET + np.arange(PACKET)).ravel()
        nodes = np.repeat(nodes, PACKET)
        exists = rows < len(points)
        rows, nodes = rows[exists], nodes[exists]
        low, high = self._boxes[0]
        gaps = np.maximum(low[nodes] - points[rows], points[rows] - high[nodes])
        near = _squares_of_positive(gaps) < squared[rows]
        return rows[near], self._order[nodes[near]]

    def _candidates_of_halves(self, points: Floats, squared: Floats) -> tuple[Indices, Indices]:
        half = -(-len(points) // (2 * PACKET)) * PACKET
        rows, triangles = self._candidates(points[:half], squared[:half])
        more_rows, more = self._candidates(points[half:], squared[half:])
        return np.concatenate([rows, more_rows + half]), np.concatenate([triangles, more])

    def _on_triangles(self, points: Floats, triangles: Indices) -> ClosestPoints:
        """Return the closest point of one triangle for each point."""
        first, second = (edges[triangles] for edges in self._edges)
        moved = points - self._origins[triangles]
        s, t = (_dots(moved, dual[triangles]) for dual in self._duals)
        outside = np.flatnonzero(~((s >= 0) & (t >= 0) & (s + t <= 1)))  # NaN: without area
        edge_gram = [gram[triangles[outside]] for gram in self._gram]
        along = _dots(moved[outside], first[outside]), _dots(moved[outside], second[outside])
        s[outside], t[outside] = _on_edges(*along, *edge_gram)
        offsets = s[:, None] * first + t[:, None] * second
        rest = moved - offsets
        return ClosestPoints(
            _dots(rest, rest), triangles.copy(), self._origins[triangles] + offsets
        )


def _dual_edges(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Return vectors whose products with an offset are its coordinates along both edges.

    They come from the cross product: determinants of edge products lose all digits of slivers.
    They are NaN for triangles without area.
    """
    normals = np.cross(first, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = np.sqrt(_dots(normals, normals))[:, None]
        normals /= lengths
        return np.cross(second, normals) / lengths, np.cross(normals, first) / lengths


def _on_edges(
    along_first: Floats, along_second: Floats, first: Floats, mixed: Floats, second: Floats
) -> tuple[Floats, Floats]:
    """Return the coordinates of the closest points on the boundaries of triangles.

    Parameters
    ----------
    along_first, along_second : float64 arrays of shape (N,)
        Products of the offsets from the first corners with the two edges there.
    first, mixed, second : float64 arrays of shape (N,)
        Products of the edges with themselves and each other.
    """
    on_first = _clipped_ratio(along_first, first)
    on_second = _clipped_ratio(along_second, second)
    on_third = _clipped_ratio(
        first - mixed + along_second - along_first, first - 2 * mixed + second
    )
    ends = np.stack(
        [[on_first, 0 * on_first], [0 * on_second, on_second], [1 - on_third, on_third]]
    )
    s, t = ends[:, 0], ends[:, 1]
    # Squared distances, less that of the first corner.
    squared = s * (s * first + 2 * t * mixed - 2 * along_first) + t * (
        t * second - 2 * along_second
    )
    edge, rows = squared.argmin(axis=0), np.arange(len(first))
    return s[edge, rows], t[edge, rows]


def _clipped_ratio(numerators: Floats, denominators: Floats) -> Floats:
    """Return ratios clipped to 0..1; 0 for edges without length."""
    ratios = np.zeros_like(numerators)
    np.divide(numerators, denominators, out=ratios, where=denominators > 0)
    return np.clip(ratios, 0.0, 1.0)


def _dots(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("na,na->n", a, b))


def _squares_of_positive(gaps: Floats) -> Floats:
    np.maximum(gaps, 0.0, out=gaps)
    return _dots(gaps, gaps)
