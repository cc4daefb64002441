"""What decoded positions say of a track: velocities by differences, normals of the surface.

`docs/format.md`, "Tracks".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.tracks import Coding, TrackHeader
from meshreel.kernel.normals import surface_normals
from meshreel.model.geometry.fans import join_fans
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer[Any]]
Values = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True)
class MovingSurface:
    """A mesh as it goes out, whose positions tracks are predicted from.

    Attributes
    ----------
    summed_faces : int32 array of shape (M, 3)
        Triangles in internal order, the order in which they are summed up, of vertices as they go
        out.
    faces : int32 array of shape (M, 3)
        As they go out.
    surface : Surface
        Says which triangles a polygon is cut into.
    vertex_of_row : integer array of shape (N,), optional
        Where values of corners are those of rows. Default: each corner has its own.
    """

    summed_faces: Faces
    faces: Faces
    surface: Surface
    vertex_of_row: Integers | None = None

    def normals(self, domain: Domain, positions: Values) -> Floats:
        """Normals of vertices, of polygons, or of the vertices of corners or rows.

        Parameters
        ----------
        domain : Domain
        positions : float array of shape (T, V, 3)

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
        return join_fans(self._sizes, self.faces)


def differences(coding: Coding | None, positions: Values) -> Floats:
    """Differences of positions of shape (T_b, V, 3) from one frame to another, of the same shape.

    At the ends of the block, where a frame is missing, the difference of the first two, or the last
    two; 0 where there is one frame alone.
    """
    given = positions.astype(np.float64)
    found = np.zeros(given.shape)
    if len(given) == 1:
        return found
    steps = given[1:] - given[:-1]
    if coding is Coding.FORWARD:
        found[:-1], found[-1] = steps, steps[-1]
    else:
        found[1:], found[0] = steps, steps[0]
    if coding is Coding.CENTRAL:
        found[1:-1] = (given[2:] - given[:-2]) / 2.0
    return found


def expected_values(
    header: TrackHeader, surface: MovingSurface, positions: Values, frames: slice
) -> Floats:
    """What a track is expected to be in some frames of a block.

    Parameters
    ----------
    header : TrackHeader
        Of a track that is predicted.
    surface : MovingSurface
    positions : float array of shape (T_b, V, 3)
        All of the block, as they go out.
    frames : slice
        The n frames.

    Returns
    -------
    float64 array of shape (n, N, 3)
    """
    if header.coding is Coding.TURNS:
        return surface.normals(header.stored_domain, positions[frames])
    first = max(0, frames.start - 1)
    near = positions[first : frames.stop + 1]
    inner = slice(frames.start - first, frames.stop - first)
    return header.rate * differences(header.coding.difference, near)[inner]


def expected_places(header: TrackHeader, expected: Floats) -> Integers:
    """Places, among the floats of a track, of what is expected of it; 0 is where it is no number.

    Parameters
    ----------
    header : TrackHeader
        Of an exact track that is predicted.
    expected : float64 array of any shape
    """
    with np.errstate(over="ignore"):
        rounded = expected.astype(header.dtype)
    return places_of(np.where(np.isfinite(rounded), rounded, header.dtype.type(0)))


def places_of(values: Values) -> Integers:
    """Floats of 4 or 8 bytes as signed integers of as many, which are in the same order."""
    bits = values.view(f"i{values.itemsize}")
    return np.asarray(bits ^ ((bits >> (8 * values.itemsize - 1)) & np.iinfo(bits.dtype).max))
