"""Velocities and normals expected from decoded positions: `docs/format.md`, "Tracks"."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.tracks import Coding, TrackHeader
from meshreel.kernel.normals import surface_normals
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer[Any]]
Values = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True)
class MovingSurface:
    """A decoded mesh whose positions predict tracks."""

    summed_faces: Faces
    """int32 array of shape (M, 3). Triangles of decoded vertices, in internal order, in which
    normals are summed.
    """
    faces: Faces
    """int32 array of shape (M, 3). Decoded faces."""
    surface: Surface
    """Maps polygons to triangles."""
    vertex_of_row: Integers | None = None
    """Integer array of shape (N,). Vertex of each row that corners share. Default: each corner has
    a separate value.
    """

    def normals(self, domain: Domain, positions: Values) -> Floats:
        """Normals of vertices, polygons, or the vertices of corners or rows.

        Returns
        -------
        float64 array of shape (T, N, 3), of length 1 or 0
        """
        positions = np.ascontiguousarray(positions)
        if domain is Domain.FACE:
            return surface_normals(positions, self.faces, self._polygons)
        of_vertices = surface_normals(positions, self.summed_faces)
        if domain is Domain.VERTEX:
            return of_vertices
        return of_vertices.take(self._vertex_of_corner, axis=1)

    @cached_property
    def _sizes(self) -> Integers:
        return self.surface.sizes(len(self.faces))

    @cached_property
    def _polygons(self) -> npt.NDArray[np.int32]:
        return np.repeat(np.arange(len(self._sizes), dtype=np.int32), self._sizes - 2)

    @cached_property
    def _vertex_of_corner(self) -> Integers:
        if self.vertex_of_row is not None:
            return self.vertex_of_row
        return join_triangles(self._sizes, self.faces)


def differences(coding: Coding | None, positions: Values) -> Floats:
    """Differences over time of positions of shape (T_b, V, 3), of the same shape.

    They are one-sided at the ends of the block, and 0 in a block of one frame.
    """
    positions = positions.astype(np.float64)
    changes = np.zeros(positions.shape)
    if len(positions) == 1:
        return changes
    steps = positions[1:] - positions[:-1]
    if coding is Coding.FORWARD:
        changes[:-1], changes[-1] = steps, steps[-1]
    else:
        changes[1:], changes[0] = steps, steps[0]
    if coding is Coding.CENTRAL:
        changes[1:-1] = (positions[2:] - positions[:-2]) / 2.0
    return changes


def expected_values(
    header: TrackHeader, surface: MovingSurface, positions: Values, frames: slice
) -> Floats:
    """Expected values of a predicted track in some frames of a block.

    Parameters
    ----------
    positions : float array of shape (T_b, V, 3)
        Decoded positions of the whole block.
    frames : slice
        The n frames.

    Returns
    -------
    float64 array of shape (n, N, 3)
    """
    if header.coding is Coding.ROTATIONS:
        return surface.normals(header.stored_domain, positions[frames])
    first = max(0, frames.start - 1)
    nearby = positions[first : frames.stop + 1]
    inner = slice(frames.start - first, frames.stop - first)
    return header.rate * differences(header.coding.difference, nearby)[inner]


def expected_ranks(header: TrackHeader, expected: Floats) -> Integers:
    """Ranks of expected values among the floats of a lossless track; non-finite values become 0."""
    with np.errstate(over="ignore"):
        rounded = expected.astype(header.dtype)
    return ranks_of(np.where(np.isfinite(rounded), rounded, header.dtype.type(0)))


def ranks_of(values: Values) -> Integers:
    """Ranks of floats: signed integers of the same size and in the same order."""
    bits = values.view(f"i{values.itemsize}")
    return np.asarray(bits ^ ((bits >> (8 * values.itemsize - 1)) & np.iinfo(bits.dtype).max))
