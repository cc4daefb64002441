"""Points on surfaces: uniform by area, and on the grid of MPEG's mesh metric."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.sequence import Faces

STRIDES = np.array([0xC13FA9A902A6328F, 0x91E10DA5C79E7B1D], np.uint64)
"""Inverse of the plastic number, and its square, times 2**64: the steps of the R2 sequence of
Martin Roberts, whose points fill the unit square evenly."""

CELLS_PER_BATCH = 1 << 20
"""Grid points tested against triangles at a time."""

TOLERANCE = 1e-9
"""Grid points this far outside a triangle, relative to its heights, count as inside."""

MERGE_BITS = 21
"""Bits of the quantized coordinates by which coincident grid points are found."""


@dataclass(frozen=True, eq=False)
class TriangleSet:
    """The triangles of a frame that have an area."""

    vertices: Floats
    """float64 array of shape (N, 3). Distinct vertices of the triangles."""
    corners: Floats
    """float64 array of shape (M, 3, 3)."""
    normals: Floats
    """float64 array of shape (M, 3). Of length 1."""
    areas: Floats
    """float64 array of shape (M,)."""
    n_degenerate: int
    """Number of excluded triangles."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on a surface, with the unit normals of their triangles, both of shape (N, 3)."""

    points: Floats
    normals: Floats


def triangle_set(vertices: Floats, faces: Faces, smallest_area: float) -> TriangleSet:
    """Return the triangles of a frame that have an area.

    Parameters
    ----------
    vertices : float64 array of shape (V, 3)
    faces : integer array of shape (M, 3)
    smallest_area : float
        Triangles of at most this area are excluded: they have no reliable normal.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    has_area = areas > smallest_area
    corners, normals, areas = corners[has_area], normals[has_area], areas[has_area]
    used_vertices = vertices[np.unique(faces[has_area])]
    unit_normals = normals / (2 * areas)[:, None]
    return TriangleSet(used_vertices, corners, unit_normals, areas, len(has_area) - len(areas))


def sample_uniformly(triangles: TriangleSet, n_samples: int) -> SurfacePoints:
    """Return points of equal density on a surface, the same in every call.

    Equal steps along the cumulative area choose the triangles, in their order; a low-discrepancy
    sequence places the points in them.

    Parameters
    ----------
    triangles : TriangleSet
        At least one triangle.
    n_samples : int
        At least 1.
    """
    cumulative = np.cumsum(triangles.areas)
    steps = (np.arange(n_samples) + 0.5) * (cumulative[-1] / n_samples)
    triangle_of = np.searchsorted(cumulative, steps, side="right").clip(max=len(cumulative) - 1)
    index = np.arange(1, n_samples + 1, dtype=np.uint64)
    s, t = ((index * stride >> np.uint64(11)) * 2.0**-53 for stride in STRIDES)
    is_outside = s + t > 1  # the other half of the parallelogram
    s, t = np.where(is_outside, 1 - s, s)[:, None], np.where(is_outside, 1 - t, t)[:, None]
    a, b, c = (triangles.corners[triangle_of, corner] for corner in range(3))
    return SurfacePoints(a + s * (b - a) + t * (c - a), triangles.normals[triangle_of])


def projected_area(triangles: TriangleSet) -> float:
    """Return the sum of the areas of triangles, each projected along the axis nearest its normal.

    Divided by the square of the step, this is about the number of points of `sample_on_grid`.
    """
    return float(triangles.areas @ np.abs(triangles.normals).max(axis=1))


def sample_on_grid(triangles: TriangleSet, low: Floats, step: float) -> SurfacePoints:
    """Return the intersections of the lines of a cubic grid with a surface, as in V-DMC.

    Each triangle is intersected with the lines along the axis nearest its normal. Coincident
    points, at edges and vertices, are merged. A surface that no line meets is sampled at the
    centroids of its triangles.

    Parameters
    ----------
    triangles : TriangleSet
        At least one triangle.
    low : float64 array of shape (3,)
        A point of the grid.
    step : float
        Distance between adjacent lines.

    References
    ----------
    MPEG's mesh metric software, mpeg-pcc-mmetric 1.1.7 (`meshToPcGrid` with `useNormal`).
    """
    corners = (triangles.corners - low) / step
    axes = np.abs(triangles.normals).argmax(axis=1)
    by_axis = [_on_lines(corners, np.flatnonzero(axes == axis), axis) for axis in range(3)]
    points = np.concatenate([points for points, _ in by_axis])
    triangle_of = np.concatenate([triangle_of for _, triangle_of in by_axis])
    if not len(points):
        points, triangle_of = corners.mean(axis=1), np.arange(len(corners))
    distinct = _distinct_points(points)
    return SurfacePoints(low + step * points[distinct], triangles.normals[triangle_of[distinct]])


def _on_lines(
    corners: Floats, numbers: npt.NDArray[np.intp], axis: int
) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Return the intersections of integer lines along an axis with triangles, and the triangles."""
    plane_axes = [other for other in range(3) if other != axis]
    flat = corners[numbers][:, :, plane_axes]
    first = np.ceil(flat.min(axis=1) - TOLERANCE)
    counts = (np.floor(flat.max(axis=1) + TOLERANCE) - first + 1).clip(min=0).astype(np.int64)
    n_cells = counts.prod(axis=1)
    borders = np.flatnonzero(np.diff(np.cumsum(n_cells) // CELLS_PER_BATCH)) + 1
    points, triangles = [np.empty((0, 3))], [np.empty(0, np.intp)]
    for part in np.split(np.arange(len(numbers)), borders):
        rows = np.repeat(part, n_cells[part])
        starts = np.cumsum(n_cells[part]) - n_cells[part]
        cells = np.arange(len(rows)) - np.repeat(starts, n_cells[part])
        lines = first[rows] + np.stack(np.divmod(cells, counts[rows, 1]), axis=1)
        origin = corners[numbers[rows], 0]
        s, t = _coordinates(lines - origin[:, plane_axes], flat[rows])
        inside = (s >= -TOLERANCE) & (t >= -TOLERANCE) & (s + t <= 1 + TOLERANCE)
        rows, lines, s, t = rows[inside], lines[inside], s[inside], t[inside]
        d0, d1, d2 = corners[numbers[rows], :, axis].T
        hits = np.empty((len(rows), 3))
        hits[:, plane_axes] = lines
        hits[:, axis] = d0 + s * (d1 - d0) + t * (d2 - d0)
        points.append(hits)
        triangles.append(numbers[rows])
    return np.concatenate(points), np.concatenate(triangles)


def _coordinates(offsets: Floats, flat: Floats) -> tuple[Floats, Floats]:
    """Return the coordinates of offsets from the first corners of triangles in the plane."""
    first, second = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    determinants = _crosses(first, second)
    return _crosses(offsets, second) / determinants, _crosses(first, offsets) / determinants


def _crosses(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _distinct_points(points: Floats) -> npt.NDArray[np.intp]:
    """Return the indices of one point of each group of points that coincide."""
    low = points.min(axis=0)
    cell = float((points - low).max()) / (2**MERGE_BITS - 1)
    cells = np.rint((points - low) / (cell or 1.0)).astype(np.int64)
    keys = (cells[:, 0] << (2 * MERGE_BITS)) | (cells[:, 1] << MERGE_BITS) | cells[:, 2]
    return np.unique(keys, return_index=True)[1]
