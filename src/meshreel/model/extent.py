"""Extent of positions: bounding boxes and their mean diagonal."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vertices = npt.NDArray[np.float32] | npt.NDArray[np.float64]
Corners = npt.NDArray[np.float64]

ROW_VERTICES = 128


@dataclass(frozen=True, eq=False)
class Extent:
    """The extent of positions, in model units."""

    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    """float64 arrays of shape (3,). Corners of the bounding box of all frames."""
    mean_diagonal: float
    """Mean of the diagonals of the bounding boxes of all frames."""


def extent_of(vertices: Vertices) -> Extent:
    """The extent of positions of shape (T, V, 3)."""
    return extent_of_boxes(*bounding_boxes(vertices))


def extent_of_boxes(low: Corners, high: Corners) -> Extent:
    """The extent of frames, given the corners of their bounding boxes, of shape (T, 3)."""
    # Halved first: the difference of two very large numbers would overflow.
    return Extent(low.min(axis=0), high.max(axis=0), 2 * mean_length(high / 2 - low / 2))


def bounding_boxes(vertices: Vertices) -> tuple[Corners, Corners]:
    """Lowest and highest corner of the bounding box of each frame, float64 of shape (T, 3)."""
    low, high = (_over_vertices(reduce, vertices) for reduce in (np.minimum, np.maximum))
    return low.astype(np.float64), high.astype(np.float64)


def _over_vertices(reduce: np.ufunc, vertices: Vertices) -> Vertices:
    """The minimum or maximum of each frame, of shape (T, 3)."""
    # Reduce rows of many vertices first: rows of three numbers take ten times as long.
    n_frames, n_verts, _ = vertices.shape
    width = min(n_verts, ROW_VERTICES)
    n_in_rows = n_verts - n_verts % width
    rows = vertices[:, :n_in_rows].reshape(n_frames, -1, width * 3)
    reduced = reduce.reduce(rows, axis=1).reshape(n_frames, width, 3)
    others = vertices[:, n_in_rows:]
    result: Vertices = reduce.reduce(np.concatenate([reduced, others], axis=1), axis=1)
    return result


def mean_length(vectors: npt.NDArray[np.float64]) -> float:
    """Mean length of vectors of shape (N, 3), also accurate for tiny vectors."""
    largest = float(np.abs(vectors).max()) or 1.0  # normalizes: squares of tiny numbers underflow
    return largest * float(np.linalg.norm(vectors / largest, axis=1).mean())
