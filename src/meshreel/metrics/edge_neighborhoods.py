"""Statistics of edge values over the vertex neighborhoods of STED."""

import numpy as np

from meshreel.arrays import Floats, Integers


class EdgeNeighborhoods:
    """For every vertex, the edges that touch it or one of its 1-ring neighbors.

    Listing the edges of each neighborhood would take V^2 entries around a hub that all vertices
    share. Instead, sums over the stars (edges at a vertex) of the closed ring of v count an edge
    twice if both its ends are in that ring; these inner edges are subtracted once.

    Parameters
    ----------
    edges : integer array of shape (E, 2)
        Every undirected edge once, ends ascending, sorted.
    """

    def __init__(self, edges: Integers, n_verts: int) -> None:
        ids, ends = np.arange(len(edges)), edges.T
        vertices = np.arange(n_verts)
        apexes, bases = _triangles(edges, n_verts)
        self._star = _Incidence(ends.ravel(), np.tile(ids, 2), (n_verts, len(edges)))
        self._ring = _Incidence(
            np.concatenate([ends[0], ends[1], vertices]),
            np.concatenate([ends[1], ends[0], vertices]),
            (n_verts, n_verts),
        )
        self._inner = _Incidence(
            np.concatenate([ends.ravel(), apexes]),
            np.concatenate([ids, ids, bases]),
            (n_verts, len(edges)),
        )

    def weighted_deviation(self, weights: Floats, values: Floats) -> tuple[Floats, Floats]:
        """Weighted standard deviation and total weight of each neighborhood.

        Squares are taken about the weighted means and merged as in Chan, Golub and LeVeque's
        parallel variance, so that a common offset of the values loses no digits.

        Parameters
        ----------
        weights, values : float64 arrays of shape (E,); weights at least 0, values finite

        Returns
        -------
        deviation, total : float64 arrays of shape (V,); both 0 where all weights are 0
        """
        star, ring, inner = self._star, self._ring, self._inner
        weighted = weights * values
        star_total = star.sums(weights)
        star_mean = _divide(star.sums(weighted), star_total)
        star_square = star.squares(weights, values, star_mean)
        total = ring.sums(star_total) - inner.sums(weights)
        mean = _divide(ring.sums(star_total * star_mean) - inner.sums(weighted), total)
        square = ring.sums(star_square) + ring.squares(star_total, star_mean, mean)
        square -= inner.squares(weights, values, mean)
        return np.sqrt(np.maximum(_divide(square, total), 0)), total


class _Incidence:
    """Row sums with a binary matrix of shape (R, C)."""

    def __init__(self, rows: Integers, columns: Integers, shape: tuple[int, int]) -> None:
        self._n_rows = shape[0]
        order = np.argsort(rows * shape[1] + columns)
        self._rows, self._columns = rows[order], columns[order]

    def sums(self, values: Floats) -> Floats:
        """Sum of the values of each row, shape (R,)."""
        return self._sums(values[self._columns])

    def squares(self, weights: Floats, values: Floats, centers: Floats) -> Floats:
        """Sum of ``weights (values - center)^2`` of each row, shape (R,)."""
        offsets = values[self._columns]
        offsets -= centers[self._rows]
        offsets *= offsets
        offsets *= weights[self._columns]
        return self._sums(offsets)

    def _sums(self, entries: Floats) -> Floats:
        # Without entries, bincount returns integers.
        return np.bincount(self._rows, entries, self._n_rows).astype(np.float64, copy=False)


def _triangles(edges: Integers, n_verts: int) -> tuple[Integers, Integers]:
    """The 3-cycles of the edge graph, faces or not: their apex vertices and their base edges."""
    tails = np.concatenate([edges[:, 0], edges[:, 1]])
    heads = np.concatenate([edges[:, 1], edges[:, 0]])
    keys = np.sort(tails * n_verts + heads)  # every directed edge, ordered by tail
    degrees = np.bincount(tails, minlength=n_verts)
    starts = np.cumsum(degrees) - degrees
    # Candidates are the neighbors of the end that has fewer, so that hubs are cheap.
    swap = degrees[edges[:, 0]] > degrees[edges[:, 1]]
    near = np.where(swap, edges[:, 1], edges[:, 0])
    far = np.where(swap, edges[:, 0], edges[:, 1])
    counts = degrees[near]
    ids = np.repeat(np.arange(len(edges)), counts)
    within = np.arange(len(ids)) - np.repeat(np.cumsum(counts) - counts, counts)
    candidates = keys[starts[near][ids] + within] % n_verts
    closing = candidates * n_verts + far[ids]
    positions = np.minimum(np.searchsorted(keys, closing), max(len(keys) - 1, 0))
    is_edge = keys[positions] == closing
    return candidates[is_edge], ids[is_edge]


def _divide(numerator: Floats, denominator: Floats) -> Floats:
    return np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0)
