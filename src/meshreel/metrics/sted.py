"""STED: a perceptual error of edge lengths and vertex speeds."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.metrics.diameter import diameter
from meshreel.metrics.reference import (
    Reference,
    bounding_box_reference,
    paired_frames,
    shared_reference,
)
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.sequence import Faces, Vertices

TIME_STEP = 3e-4
"""dt, the length of a frame on the time axis, in diameters of the model."""
TEMPORAL_WEIGHT = 9.144e-5
"""c, the weight of the temporal error relative to the spatial error."""
FRAMES_BEFORE, FRAMES_AFTER = 4, 5
"""The window of a mean speed: moves f-4 to f+5 around move f, cut at the ends."""

_BLOCK_VALUES = 1 << 18


@dataclass(frozen=True)
class Sted:
    """STED and its two parts, all without unit; 0 for equal sequences."""

    spatial: float
    """S, the mean local standard deviation of relative edge lengths."""
    temporal: float
    """T, the mean relative error of the speeds; 0 for a single frame."""
    sted: float
    """``sqrt(S^2 + c^2 T^2)`` with c = 9.144e-5: T has little influence."""


@np.errstate(over="ignore", invalid="ignore")
def sted(original: Vertices, decoded: Vertices, faces: Faces) -> Sted:
    """STED between two sequences of the same connectivity, with the authors' constants.

    Spatial part: every edge of every frame has the signed relative error ``(l - l^) / l``. Each
    vertex has their standard deviation, weighted by l, over all edges that touch it or one of its
    1-ring neighbors. S is the mean over vertices and frames. Edges of zero original length have
    weight 0, and neighborhoods of zero length (isolated vertices) are excluded.

    Temporal part: with lengths in units of D, the largest distance between two vertices of the
    original frame 0, a vertex moves ``s = sqrt(|p_f - p_(f-1)|^2 + dt^2)``. T is the mean over
    vertices and frame pairs of ``|s - s^|``, divided by the mean s of the vertex in the window
    f-5 < f' <= f+5. If frame 0 is a single point, D is the diagonal of the whole original; if that
    is 0 too, T is 0 for a static decoded sequence and infinite otherwise.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite
    faces : integer array of shape (M, 3)

    Raises
    ------
    InvalidInputError
        If the shapes differ.

    Source: Vasa and Skala, "A perception correlated comparison method for dynamic meshes",
    IEEE TVCG 17(2), 2011.
    """
    reference = shared_reference(original, decoded)
    spatial = LocalSted(faces, original.shape[1]).mean(original, decoded, reference)
    temporal = _temporal_error(original, decoded, reference)
    return Sted(spatial, temporal, math.hypot(spatial, TEMPORAL_WEIGHT * temporal))


class LocalSted:
    """Standard deviations of relative edge errors around each vertex, of frames of one mesh.

    They are weighted by length, over all edges that touch a vertex or one of its neighbors; see
    `sted`. Their mean over vertices with edges of positive length is the spatial STED.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
    """

    def __init__(self, faces: Faces, n_verts: int) -> None:
        self._edges = undirected_edges(faces)
        self._neighborhoods = EdgeNeighborhoods(self._edges, n_verts)

    @np.errstate(over="ignore", invalid="ignore")
    def field(self, original: Vertices, decoded: Vertices) -> Floats:
        """Values of a frame, of shape (V,); 0 for vertices without stretched edges.

        Parameters and errors are those of `sted`, for positions of shape (V, 3).
        """
        pair = original[np.newaxis], decoded[np.newaxis]
        return next(self._fields(*pair, shared_reference(*pair)))[0]

    @np.errstate(over="ignore", invalid="ignore")
    def mean(self, original: Vertices, decoded: Vertices, reference: Reference) -> float:
        """Spatial STED of frames of shape (T, V, 3)."""
        total, n_measured = 0.0, 0
        for deviations, weights in self._fields(original, decoded, reference):
            total += float(deviations.sum())  # a neighborhood of zero length adds 0
            n_measured += int(np.count_nonzero(weights))
        if math.isnan(total):  # a decoded edge too long for float64
            return math.inf
        return total / max(n_measured, 1)

    def _fields(
        self, original: Vertices, decoded: Vertices, reference: Reference
    ) -> Iterator[tuple[Floats, Floats]]:
        """Yield the deviations and weights of each frame, of shape (V,)."""
        for pair in paired_frames(original, decoded, reference):
            yield self._neighborhoods.weighted_deviation(*relative_edge_errors(*pair, self._edges))


def relative_edge_errors(
    frame: Floats, displacement: Floats, edges: Integers
) -> tuple[Floats, Floats]:
    """Edge lengths of one frame and their signed relative errors, each of shape (E,).

    Parameters
    ----------
    frame, displacement : float64 arrays of shape (V, 3)
        From `paired_frames`.
    edges : integer array of shape (E, 2)
    """
    along = frame[edges[:, 1]] - frame[edges[:, 0]]
    change = displacement[edges[:, 0]] - displacement[edges[:, 1]]
    along_hat = along - change
    lengths, lengths_hat = _lengths(along), _lengths(along_hat)
    # l - l^ = (l^2 - l^^2) / (l + l^): small errors keep their digits.
    squares = np.einsum("ea,ea->e", change, along + along_hat)
    sizes = lengths * (lengths + lengths_hat)
    return lengths, np.divide(squares, sizes, out=np.zeros_like(squares), where=sizes > 0)


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


def _temporal_error(original: Vertices, decoded: Vertices, reference: Reference) -> float:
    n_frames, n_verts = original.shape[:2]
    if n_frames == 1:
        return 0.0
    first = bounding_box_reference(original[0])
    unit = diameter(first.apply(original[0])) / first.scale * reference.scale
    unit = unit or reference.diagonal_scaled
    if unit == 0:
        return math.inf if np.any(decoded != decoded[0]) else 0.0
    block = max(1, _BLOCK_VALUES // n_frames)
    total = 0.0
    for start in range(0, n_verts, block):
        part = slice(start, start + block)
        moves, moves_hat = (
            np.diff(vertices[:, part].astype(np.float64) * reference.scale, axis=0)
            for vertices in (original, decoded)
        )
        speeds, speeds_hat = (
            np.sqrt(np.einsum("fva,fva->fv", each, each) + (TIME_STEP * unit) ** 2)
            for each in (moves, moves_hat)
        )
        # s - s^ = (s^2 - s^^2) / (s + s^): small errors keep their digits.
        squares = np.einsum("fva,fva->fv", moves - moves_hat, moves + moves_hat)
        errors = np.abs(squares) / (speeds + speeds_hat)
        total += float((errors / _windowed_means(speeds)).sum())
    return math.inf if math.isnan(total) else total / (n_verts * (n_frames - 1))


def _windowed_means(speeds: Floats) -> Floats:
    sums, counts = np.zeros_like(speeds), np.zeros((len(speeds), 1))
    for shift in range(-FRAMES_BEFORE, FRAMES_AFTER + 1):
        inside = slice(max(0, -shift), max(0, len(speeds) - max(0, shift)))
        shifted = slice(max(0, shift), max(0, len(speeds) + min(0, shift)))
        sums[inside] += speeds[shifted]
        counts[inside] += 1
    return np.asarray(sums / counts)


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("ea,ea->e", vectors, vectors)))
