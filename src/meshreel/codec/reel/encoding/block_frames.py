"""A block of frames with its coordinates and eigen-trajectories."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.reel.normative.fields import PointWeights
from meshreel.codec.subspace.pca import fix_signs, gram_of_rows, truncated_pca
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.kernel.frames import coordinate_rows
from meshreel.runtime.threads import chunks, in_chunks

MAX_CACHED = 1 << 23
"""Maximum number of coordinates cached as float64; larger blocks recompute them."""

LARGEST_INTEGER = 2.0**29
"""Quantized values stay below this; residuals may be larger."""

CHUNK_VERTICES = 2048
"""Number of vertices whose fields are computed at a time."""

SAMPLES = 1024
"""Minimum number of vertices sampled to detect rest."""

SKETCH_RATIO = 64
"""Columns of a sketch per row. With K modes, a sketch increases the residual by a share of about
K / columns, less than 1 / 64."""


@dataclass
class BlockFrames:
    """A block of frames with its trajectories, which do not change with the step."""

    vertices: npt.NDArray[np.floating]
    """float array of shape (T, V, C). Positions, or values of another track; contiguous."""
    frame: BoundingFrame
    """Origin and scale of coordinates."""
    order: npt.NDArray[np.int32] | None = None
    """int32 array of shape (V,), or None. Given number of each internal vertex; None: `vertices`
    are in internal order.
    """
    subtracted: tuple[Floats, Floats] | None = None
    """tuple of float64 arrays of shapes (C, T, R) and (V, R), or None. Vectors and fields, in
    internal order, whose product is subtracted.
    """
    from_points: PointWeights | None = None
    """Initial weights of predictions; None derives them from connectivity."""
    _cached: dict[bool, tuple[float, Floats, Floats]] = field(default_factory=dict)
    n_frames: int = field(init=False)
    n_verts: int = field(init=False)
    n_columns: int = field(init=False)
    """T, V and C."""

    def __post_init__(self) -> None:
        self.n_frames, self.n_verts, self.n_columns = map(int, self.vertices.shape)

    @property
    def internal_vertices(self) -> npt.NDArray[np.floating]:
        """The values, with vertices in internal order."""
        return self.vertices if self.order is None else self.vertices.take(self.order, axis=1)

    def internal_frame(self, number: int) -> npt.NDArray[np.floating]:
        """One frame of the values, of shape (V, C), with vertices in internal order."""
        frame = self.vertices[number]
        return np.asarray(frame if self.order is None else frame[self.order])

    @cached_property
    def rounding(self) -> float:
        """Largest rounding error of a position by its number type, in diagonals."""
        vertices = self.vertices
        return largest_rounding(vertices.min(), vertices.max(), vertices.dtype, self.frame)

    def coordinates(self, piece: slice, frames: slice = slice(None)) -> Floats:
        """Coordinates of some vertices, in internal order: of shape (C T, n), x before y and z.

        Coordinates of all frames may be cached and must not be changed; those of some frames are a
        copy.
        """
        if self.vertices.size > MAX_CACHED:
            return self._rows(piece, frames)
        if frames == slice(None):
            return self._all[:, piece]
        if self.subtracted is not None:
            return self._rows(piece, frames)
        rows = self._all.reshape(self.n_columns, self.n_frames, -1)
        coordinates = np.array(rows[:, frames, piece])
        return coordinates.reshape(-1, coordinates.shape[2])

    def _rows(self, piece: slice, frames: slice = slice(None)) -> Floats:
        placement = self.frame.placement
        rows = coordinate_rows(self.vertices[frames], self.order, piece, placement)
        if self.subtracted is not None:
            vectors, fields = self.subtracted
            rows -= vectors[:, frames].reshape(len(rows), -1) @ fields[piece].T
        return rows

    @cached_property
    def _all(self) -> Floats:
        if self.subtracted is None:
            return self._rows(slice(0, self.n_verts))
        columns = np.empty((self._n_rows, self.n_verts))

        def fill(piece: slice) -> None:
            columns[:, piece] = self._rows(piece)

        in_chunks(fill, self.n_verts, CHUNK_VERTICES)
        return columns

    @property
    def _n_sketched(self) -> int:
        """Number of columns of the sketch for trajectories; 0: use all vertices instead."""
        pieces = SKETCH_RATIO * self._n_rows // CHUNK_VERTICES + 1
        return CHUNK_VERTICES * pieces if 2 * CHUNK_VERTICES * pieces <= self.n_verts else 0

    def _sketch(self, piece: slice) -> Floats:
        """Return some columns of a sketch, whose Gram matrix is nearly that of all vertices.

        Each column is the sum of some vertices with random signs (a "count sketch": Charikar, Chen
        and Farach-Colton, 2002; for matrices Clarkson and Woodruff, 2013).
        """
        columns = np.zeros((self._n_rows, piece.stop - piece.start))
        placement = self.frame.placement
        for start in range(piece.start, self.n_verts, self._n_sketched):
            part = slice(start, min(start + columns.shape[1], self.n_verts))
            count = part.stop - start
            signs = np.random.default_rng(start).integers(0, 2, count) * 2.0 - 1.0
            sums = columns if count == columns.shape[1] else np.zeros((len(columns), count))
            coordinate_rows(self.vertices, self.order, part, placement, signs, sums)
            if self.subtracted is not None:
                vectors, fields = self.subtracted
                sums -= vectors.reshape(len(sums), -1) @ (fields[part].T * signs)
            if sums is not columns:
                columns[:, :count] += sums
        return columns

    @property
    def _representative_columns(self) -> tuple[Callable[[slice], Floats], int]:
        """Columns that determine the trajectories, and their number."""
        if self._n_sketched:
            return self._sketch, self._n_sketched
        return self.coordinates, self.n_verts

    @cached_property
    def _gram(self) -> Floats:
        columns, n_columns = self._representative_columns
        return gram_of_rows(columns, self._n_rows, n_columns)

    @property
    def _n_rows(self) -> int:
        return self.n_columns * self.n_frames

    @cached_property
    def energy(self) -> float:
        """Sum of all squared coordinates."""
        if self._n_rows <= self.n_verts and not self._n_sketched:
            return float(np.trace(self._gram))
        pieces = chunks(self.n_verts, CHUNK_VERTICES)
        return sum(float(np.square(self.coordinates(piece)).sum()) for piece in pieces)

    @cached_property
    def spread(self) -> float:
        """Sum of the squared distances of all positions from the mean of their frame."""
        first = self.coordinates(slice(0, 1))  # subtracted, so that equal vertices give exactly 0
        sums, total = np.zeros(len(first)), 0.0
        for piece in chunks(self.n_verts, CHUNK_VERTICES):
            around = self.coordinates(piece) - first
            sums += around.sum(axis=1)
            total += float(np.vdot(around, around))
        return total - float(sums @ sums) / self.n_verts

    @cached_property
    def sampled_motion(self) -> tuple[Floats, Floats]:
        """Motion of sampled vertices, in diagonals.

        Distances between consecutive frames, of shape (T - 1, n), and diagonals of the bounding
        boxes of their paths, of shape (n,).
        """
        sample = self.vertices[:, :: max(1, self.n_verts // SAMPLES)] / np.float64(self.frame.scale)
        steps = np.linalg.norm(np.diff(sample, axis=0), axis=2)
        return steps, np.linalg.norm(np.ptp(sample, axis=0), axis=1)

    def trajectories(self, least: float, *, with_means: bool = False) -> tuple[Floats, Floats]:
        """Return singular values above `least`, at least one, and basis vectors of shape (C T, K).

        With means, the means over time are separate modes: their vectors are constant in one column
        and 0 in the others, and the fields of all other modes are 0 at vertices that never move.
        """
        cached = self._cached.get(with_means)
        if cached is None or cached[0] > least:
            find = self._trajectories_and_means if with_means else self._trajectories
            self._cached[with_means] = cached = (least, *find(least))
        _, strengths, vectors = cached
        n_kept = max(1, int(np.sum(strengths > least)))
        return strengths[:n_kept], vectors[:, :n_kept]

    def _trajectories_and_means(self, least: float) -> tuple[Floats, Floats]:
        squared = np.zeros(self.n_columns)
        for piece in chunks(self.n_verts, CHUNK_VERTICES):
            squared += np.square(self._by_column(self.coordinates(piece)).mean(axis=1)).sum(axis=1)
        constant = np.full((self.n_frames, 1), 1.0 / math.sqrt(self.n_frames))
        strengths, vectors = self._trajectories(least, self._without_means)
        strengths = np.concatenate([np.sqrt(squared * self.n_frames), strengths])
        vectors = np.hstack([np.kron(np.eye(self.n_columns), constant), vectors])
        order = np.argsort(-strengths, kind="stable")
        return strengths[order], vectors[:, order]

    def _by_column(self, rows: Floats) -> Floats:
        return rows.reshape(self.n_columns, self.n_frames, -1)

    def _without_means(self, rows: Floats) -> Floats:
        """Subtract the mean over time from coordinates of shape (C T, n)."""
        by_column = self._by_column(rows)
        return np.asarray((by_column - by_column.mean(axis=1, keepdims=True)).reshape(rows.shape))

    def _trajectories(
        self, least: float, transform: Callable[[Floats], Floats] | None = None
    ) -> tuple[Floats, Floats]:
        """Trajectories of coordinates, or of a linear transform of their columns."""
        if self._n_rows < self.n_verts:
            columns, n_columns = self._representative_columns
            if transform is None:
                return truncated_pca(columns, self._gram, n_columns, least)

            def transformed(piece: slice) -> Floats:
                return transform(columns(piece))

            gram = gram_of_rows(transformed, self._n_rows, n_columns)
            return truncated_pca(transformed, gram, n_columns, least)
        rows = self.coordinates(slice(0, self.n_verts))
        rows = rows if transform is None else transform(rows)

        def frames(piece: slice) -> Floats:
            return np.asarray(rows.T[:, piece])

        gram = gram_of_rows(frames, self.n_verts, self._n_rows)
        strengths, fields = truncated_pca(frames, gram, self._n_rows, least)
        divisors = np.where(strengths > 0, strengths, 1.0)
        return strengths, fix_signs(rows @ fields / divisors)


def largest_rounding(
    low: float, high: float, dtype: np.dtype[np.floating], frame: BoundingFrame
) -> float:
    """Largest rounding error, in diagonals, of a position with coordinates between low and high."""
    spacing = float(np.spacing(np.maximum(abs(low), abs(high)).astype(dtype)))
    return float(np.sqrt(len(frame.origin)) * spacing / frame.scale)
