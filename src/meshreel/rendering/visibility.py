"""Visible face of each pixel: vectorized scan conversion into a z-buffer.

Array operations split triangles into pixel rows and rows into pixels, so the cost depends on the
number of covered pixels, not on the sizes of the triangles.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.model.sequence import Faces

_CHUNK_SIZE = 1 << 18
"""Rows or pixels per chunk; bounds the working memory to about 50 MB."""

_NEAR = 1e-6
"""Points nearer than this fraction of the largest depth count as behind the eye."""


def inverse_depths(depths: Floats) -> Floats:
    """The largest depth divided by each depth, linear in picture space; 0 behind the eye."""
    farthest = max(float(depths.max()), 0.0)
    in_front = depths > _NEAR * farthest
    return np.divide(farthest, depths, out=np.zeros_like(depths), where=in_front)


def signed_areas(points: Floats, faces: Faces) -> Floats:
    """Twice the area of every face in square pixels; negative for front faces."""
    ab, ac = (points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))
    areas: Floats = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    return areas


def visible_faces(
    points: Floats,
    inv_depth: Floats,
    faces: Faces,
    size: tuple[int, int],
    shown: npt.NDArray[np.bool_] | None = None,
) -> Integers:
    """The face visible at the center of each pixel, or -1.

    Parameters
    ----------
    points : float array of shape (V, 2)
        In pixels, from `Camera.project`.
    inv_depth : float array of shape (V,)
        From `inverse_depths`; faces with a vertex behind the eye are skipped.
    faces : integer array of shape (M, 3)
    size : tuple of 2 ints
        Width and height of the picture.
    shown : bool array of shape (M,), optional
        Faces to draw. Default: all.

    Returns
    -------
    int64 array of shape (height * width,), row by row

    Faces that share an edge cover each pixel along it exactly once. Of faces at the same depth the
    last one is visible.
    """
    width, height = size
    is_drawn = (inv_depth[faces] > 0).all(axis=1) & (signed_areas(points, faces) != 0)
    ids = np.flatnonzero(is_drawn if shown is None else is_drawn & shown)
    corners = np.concatenate([points, inv_depth[:, None]], axis=1)[faces[ids]]
    order = np.argsort(corners[:, :, 1], axis=1)
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    # Keys contain the inverse depth in the high and the face number in the low bits: positive
    # floats sort like their bits, so the maximum is the nearest face, in any order of evaluation.
    buffer = np.full(width * height, -1, np.int64)
    top, n_rows = _pixel_span(corners[:, 0, 1], corners[:, 2, 1], height)
    for group in _chunks(n_rows):
        owner, row = _expand(top[group], n_rows[group])
        x_left, x_right, left_inv_depth, slope = _row_ends(corners[group][owner], row)
        first, n_columns = _pixel_span(x_left, x_right, width)
        for rows in _chunks(n_columns):
            line, column = _expand(first[rows], n_columns[rows])
            offset = column + 0.5 - x_left[rows][line]
            inverse = (left_inv_depth[rows][line] + slope[rows][line] * offset).astype(np.float32)
            key = inverse.view(np.int32).astype(np.int64) << 32
            key |= ids[group][owner[rows]][line]
            np.maximum.at(buffer, row[rows][line] * width + column, key)
    return np.where(buffer < 0, -1, buffer & 0xFFFFFFFF)


def _pixel_span(low: Floats, high: Floats, n_pixels: int) -> tuple[Integers, Integers]:
    """First pixel and number of pixels with centers in [low, high)."""
    first = np.clip(np.ceil(low - 0.5), 0, n_pixels).astype(np.int64)
    return first, np.clip(np.ceil(high - 0.5), 0, n_pixels).astype(np.int64) - first


def _expand(first: Integers, count: Integers) -> tuple[Integers, Integers]:
    """The index i and each integer of the ranges ``first[i] .. first[i] + count[i] - 1``."""
    owner = np.repeat(np.arange(len(count)), count)
    starts = np.cumsum(count) - count
    return owner, np.arange(len(owner)) + (first - starts)[owner]


def _chunks(count: Integers) -> Iterator[slice]:
    """Slices whose counts add up to about `_CHUNK_SIZE`."""
    group = np.cumsum(count) // _CHUNK_SIZE
    ends = [*(np.flatnonzero(np.diff(group)) + 1).tolist(), len(count)]
    return (slice(*pair) for pair in zip([0, *ends[:-1]], ends, strict=True))


def _row_ends(corners: Floats, row: Integers) -> tuple[Floats, Floats, Floats, Floats]:
    """Left x, right x, left inverse depth and its slope where a row intersects its triangle.

    Parameters
    ----------
    corners : float array of shape (N, 3, 3)
        x, y and inverse depth of each corner, by ascending y. Edges are always evaluated from
        smaller to larger y, so that two faces agree on their common edge to the last bit.
    row : integer array of shape (N,)
    """
    y = np.asarray(row + 0.5, np.float64)
    low, middle, high = corners[:, 0], corners[:, 1], corners[:, 2]
    above = (y < middle[:, 1])[:, None]
    long = _along_edge(low, high, y)
    short = _along_edge(np.where(above, low, middle), np.where(above, middle, high), y)
    swap = (long[:, 0] > short[:, 0])[:, None]
    left, right = np.where(swap, short, long), np.where(swap, long, short)
    width = right[:, 0] - left[:, 0]
    rise = right[:, 1] - left[:, 1]
    slope = np.divide(rise, width, out=np.zeros_like(width), where=width > 0)
    return left[:, 0], right[:, 0], left[:, 1], slope


def _along_edge(start: Floats, end: Floats, y: Floats) -> Floats:
    """The x and inverse depth of edges at height y, shape (N, 2)."""
    height = end[:, 1] - start[:, 1]
    share = np.divide(y - start[:, 1], height, out=np.zeros_like(y), where=height > 0)
    values: Floats = start[:, ::2] + share[:, None] * (end[:, ::2] - start[:, ::2])
    return values
