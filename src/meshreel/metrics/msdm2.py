"""MSDM2: a perceptual error of the curvature of a mesh at several scales."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.closest import TriangleTree
from meshreel.metrics.reference import require_equal_frame_counts
from meshreel.model.frame_choice import spread_frames
from meshreel.model.geometry.connectivity import undirected_edges
from meshreel.model.geometry.normals import face_normals, unit
from meshreel.model.sequence import Faces, MeshSequence, single_segment

SCALES = 0.002, 0.003, 0.004
"""Radii of the neighborhoods of curvature, in the longest side of the bounding box."""

STATISTICS_RATIO = 5.0
"""Radius of the neighborhoods of statistics, in radii of curvature."""

STRUCTURE_WEIGHT = 0.5
"""Weight of the structure term; those of curvature and contrast are 1."""

POOLING_EXPONENT = 3

MIN_SHARE = 1e-16, 0.01
"""Shares of an edge in a sphere below the first become the second, as in MEPP2."""


def msdm2(original: MeshSequence, decoded: MeshSequence, n_frames: int = 16) -> Floats:
    """MSDM2 of evenly spaced frames, which correlates with perceived errors of meshes.

    Parameters
    ----------
    original, decoded : MeshSequence
        Of equal frame counts, each with constant faces, which may differ.
    n_frames : int
        Maximum number of frames; one of 10,000 vertices takes about two seconds.

    Returns
    -------
    float64 array of shape (n,), 0 (equal) to 1

    Raises
    ------
    ConnectivityChangeError
        If the faces of a sequence change.
    InvalidInputError
        If frame counts differ, a sequence has no face, or `n_frames` is below 1.

    References
    ----------
    G. Lavoue, "A multiscale metric for 3D mesh visual quality assessment", Computer Graphics Forum
    30(5), 2011. Values of vertices equal those of the author's implementation in MEPP2, except near
    vertices whose closest point lies on an edge of the original: the choice of its face matters,
    so that moving a model may change the result by a thousandth.
    """
    if n_frames < 1:
        raise InvalidInputError(Keyword("n_frames"), f" must be at least 1; got {n_frames}")
    pair = [single_segment(each, "MSDM2") for each in (original, decoded)]
    require_equal_frame_counts(original, decoded, "MSDM2 compares equal numbers of frames")
    if not all(len(each.faces) for each in pair):
        raise InvalidInputError("MSDM2 needs faces, and a sequence has none")
    measure = Msdm2(pair[0].faces, pair[1].faces)
    numbers = spread_frames(range(original.n_frames), n_frames)
    frames = ((each.read(n, n + 1)[0] for each in pair) for n in numbers)
    return np.array([measure.of(*both) for both in frames])


class Msdm2:
    """MSDM2 of frames of a decoded mesh against frames of an original; see `msdm2`.

    Per scale, the curvature of a vertex is the mean magnitude of the principal curvatures, by the
    tensor of the edges within a radius. A decoded vertex receives the curvature of the closest
    point of the original. Around each vertex, Gaussian means, deviations and the covariance of both
    curvatures give differences of curvature, contrast and structure; the result is the mean of the
    scales. Constants and details are those of the author's implementation in MEPP2.

    Parameters
    ----------
    faces, decoded_faces : integer arrays of shape (M, 3) and (M', 3)
        Of the original, and of the decoded mesh.
    """

    def __init__(self, faces: Faces, decoded_faces: Faces) -> None:
        self._original = _Edges(faces)
        is_same = np.array_equal(faces, decoded_faces)
        self._decoded = self._original if is_same else _Edges(decoded_faces)

    def of(self, original: Floats, decoded: Floats) -> float:
        """MSDM2 of a frame, 0 to 1: the Minkowski mean of `of_vertices` with exponent 3.

        Isolated vertices are excluded.
        """
        values = self.of_vertices(original, decoded)[np.unique(self._decoded.starts)]
        mean = np.mean(values**POOLING_EXPONENT) if len(values) else 0.0
        return float(mean ** (1 / POOLING_EXPONENT))

    def of_vertices(self, original: Floats, decoded: Floats) -> Floats:
        """MSDM2 of each vertex of a frame, of shape (V,).

        Parameters
        ----------
        original, decoded : float arrays of shapes (V', 3) and (V, 3)
        """
        original, decoded = original.astype(np.float64), decoded.astype(np.float64)
        size = float(np.ptp(decoded, axis=0).max())
        values = np.zeros(len(decoded))
        if not size:
            return values
        tree = TriangleTree(original, self._original.faces)
        closest = tree.closest(decoded)
        corners = self._original.faces[closest.faces]
        shares = _corner_shares(original[corners] - decoded[:, None])
        for scale in SCALES:
            radius = scale * size
            curvature = size * self._decoded.curvature(decoded, radius)
            others = size * self._original.curvature(original, radius)
            matched = np.einsum("vk,vk->v", shares, others[corners])
            near = self._decoded.within(decoded, STATISTICS_RATIO * radius)
            values += _differences(near, decoded, closest.points, curvature, matched)
        return values / len(SCALES)


@dataclass(frozen=True, eq=False)
class _Neighborhoods:
    """Directed edges around each vertex, clipped by a sphere around it."""

    radius: float
    centers: Integers
    edges: Integers
    """Integer arrays of shape (N,). Center of the sphere, and number of the edge."""
    starts: Integers
    ends: Integers
    shares: Floats
    """float64 array of shape (N,). Share of the edge within the sphere, from its start."""
    is_sample: npt.NDArray[np.bool_]
    """Whether the end of the share is a new sample: not of an edge to a vertex reached before."""


class _Edges:
    """The directed edges of a mesh, by their start."""

    def __init__(self, faces: Faces) -> None:
        self.faces = faces
        edges = undirected_edges(faces)
        both = np.concatenate([edges, edges[:, ::-1]])
        starts, ends = both[np.lexsort(both.T[::-1])].T
        self.starts, self.ends = starts.astype(np.int64), ends.astype(np.int64)
        self._n_verts = int(faces.max()) + 1
        self._first = np.searchsorted(self.starts, np.arange(self._n_verts + 1))
        corners = faces.astype(np.int64)
        sides = (corners * self._n_verts + np.roll(corners, -1, axis=1)).ravel()
        keys, place = np.unique(sides, return_index=True)

        def face_of(starts: Integers, ends: Integers) -> Integers:
            """Face on the left of each directed edge; -1 without one."""
            wanted = starts * self._n_verts + ends
            found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            return np.where(keys[found] == wanted, place[found] // 3, -1)

        self._left = face_of(self.starts, self.ends)
        self._right = face_of(self.ends, self.starts)

    def curvature(self, points: Floats, radius: float) -> Floats:
        """Mean magnitude of the principal curvatures of each vertex, of shape (V,).

        The tensor of D. Cohen-Steiner, J.-M. Morvan, "Restricted Delaunay triangulations and normal
        cycle", 2003: edges within a sphere, weighted by the angles between their faces.
        """
        vectors = points[self.ends] - points[self.starts]
        lengths = np.linalg.norm(vectors, axis=1)
        directions = unit(vectors)
        normals = unit(face_normals(points, self.faces))
        sines = np.einsum(
            "ei,ei->e", np.cross(normals[self._left], normals[self._right]), directions
        )
        has_faces = (self._left >= 0) & (self._right >= 0)
        bends = np.where(has_faces, np.arcsin(np.clip(sines, -1, 1)), 0.0)
        near = self.within(points, radius)
        weights = (bends * lengths)[near.edges] * near.shares
        u = directions[near.edges]
        tensors = np.empty((len(points), 3, 3))
        for i in range(3):
            for j in range(3):
                products = weights * u[:, i] * u[:, j]
                tensors[:, i, j] = np.bincount(near.centers, products, len(points))
        values = np.linalg.eigvalsh(tensors / (np.pi * radius**2))
        return np.asarray(np.sort(np.abs(values), axis=1)[:, 1:].mean(axis=1))

    def within(self, points: Floats, radius: float) -> _Neighborhoods:
        """Edges around each vertex, from vertices within a sphere, outwards.

        An edge belongs to a neighborhood if it begins at the center, or at a vertex within that is
        reached by such edges, and leads away from the center.
        """
        centers = np.arange(min(len(points), self._n_verts))
        centers = centers[np.diff(self._first)[centers] > 0]
        fronts, reached = centers, centers * self._n_verts + centers
        found: list[tuple[Integers, Integers, Floats, npt.NDArray[np.bool_]]] = []
        while len(fronts):
            counts = np.diff(self._first)[fronts]
            edges = np.repeat(self._first[fronts], counts) + _ranges(counts)
            centers = np.repeat(centers, counts)
            starts, ends = self.starts[edges], self.ends[edges]
            offsets, vectors = points[starts] - points[centers], points[ends] - points[starts]
            is_out = (starts == centers) | (np.einsum("ni,ni->n", vectors, offsets) > 0)
            edges, centers, ends = edges[is_out], centers[is_out], ends[is_out]
            shares, is_inside = _clipped(offsets[is_out], vectors[is_out], radius)
            pairs = np.where(is_inside, centers * self._n_verts + ends, -1)
            _, place = np.unique(pairs, return_index=True)
            is_new = np.zeros(len(pairs), bool)
            is_new[place] = True
            is_new &= is_inside & ~np.isin(pairs, reached)
            found.append((centers, edges, shares, is_new | ~is_inside))
            reached = np.concatenate([reached, pairs[is_new]])
            fronts, centers = ends[is_new], centers[is_new]
        if not found:
            empty = np.zeros(0, np.int64)
            found = [(empty, empty, np.zeros(0), np.zeros(0, bool))]
        centers, edges, shares, is_sample = map(np.concatenate, zip(*found, strict=True))
        return _Neighborhoods(
            radius, centers, edges, self.starts[edges], self.ends[edges], shares, is_sample
        )


def _corner_shares(offsets: Floats) -> Floats:
    """Weights of the corners of the closest faces, of shape (V, 3).

    As in MEPP2, they are the areas that a vertex itself spans with the opposite sides, which are
    barycentric coordinates only in the plane of the face.

    Parameters
    ----------
    offsets : float64 array of shape (V, 3, 3)
        Corners relative to the vertex.
    """
    spanned = np.cross(np.roll(offsets, -1, axis=1), np.roll(offsets, -2, axis=1))
    areas = np.linalg.norm(spanned, axis=2)
    totals = areas.sum(axis=1, keepdims=True)
    shares = np.divide(areas, totals, out=np.full_like(areas, 1 / 3), where=totals > 0)
    return np.asarray(shares)


def _ranges(counts: Integers) -> Integers:
    """The concatenation of 0, 1, ..., count - 1 of each count."""
    return np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)


def _clipped(
    offsets: Floats, vectors: Floats, radius: float
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Share of each vector within a sphere, and whether all of it is.

    Parameters
    ----------
    offsets, vectors : float64 arrays of shape (N, 3)
        Start relative to the center, and vector.
    """
    a = np.einsum("ni,ni->n", vectors, vectors)
    b = np.einsum("ni,ni->n", vectors, offsets)
    c = np.einsum("ni,ni->n", offsets, offsets) - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    shares = np.divide(root - b, a, out=np.zeros_like(a), where=a > 0)
    shares = np.where((shares >= 0) & (shares < MIN_SHARE[0]), MIN_SHARE[1], shares)
    is_clipped = (a == 0) | (b * b - a * c < 0) | (shares < 1)
    is_valid = (a > 0) & (b * b - a * c >= 0) & (shares >= 0)
    return np.where(is_valid, np.minimum(shares, 1.0), 1.0), ~is_clipped


def _differences(
    near: _Neighborhoods, points: Floats, matched_points: Floats, own: Floats, matched: Floats
) -> Floats:
    """MSDM2 of each vertex at one scale, of shape (V,)."""
    n_verts, some = len(points), near.is_sample
    centers, shares = near.centers[some], near.shares[some]
    everything = np.arange(n_verts)
    centers = np.concatenate([everything, centers])

    def sampled(values: Floats) -> Floats:
        """Values at the centers, then at the ends of clipped edges."""
        first, last = values[near.starts[some]], values[near.ends[some]]
        share = shares if values.ndim == 1 else shares[:, None]
        return np.asarray(np.concatenate([values, first + share * (last - first)]))

    def weights(positions: Floats) -> Floats:
        distances = np.linalg.norm(sampled(positions) - positions[centers], axis=1)
        return np.asarray(np.exp(-2 * (distances / near.radius) ** 2))

    def sums(values: Floats) -> Floats:
        return np.bincount(centers, values, n_verts).astype(np.float64)

    w_1, w_2, x_1, x_2 = weights(points), weights(matched_points), sampled(own), sampled(matched)
    total_1, total_2 = sums(w_1), sums(w_2)
    mean_1, mean_2 = sums(w_1 * x_1) / total_1, sums(w_2 * x_2) / total_2
    d_1, d_2 = x_1 - mean_1[centers], x_2 - mean_2[centers]
    deviation_1 = np.sqrt(sums(w_1 * d_1**2) / total_1)
    deviation_2 = np.sqrt(sums(w_2 * d_2**2) / total_2)
    covariance = sums(w_2 * d_1 * d_2) / total_1
    product = deviation_1 * deviation_2
    curvature = np.abs(mean_1 - mean_2) / (np.maximum(mean_1, mean_2) + 1)
    contrast = np.abs(deviation_1 - deviation_2) / (np.maximum(deviation_1, deviation_2) + 1)
    structure = np.abs(product - covariance) / (product + 1)
    total = curvature + contrast + STRUCTURE_WEIGHT * structure
    return np.asarray(total / (2 + STRUCTURE_WEIGHT))
