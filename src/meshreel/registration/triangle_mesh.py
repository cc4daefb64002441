"""A triangle mesh in registration: closest points, normals, and samples."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.closest import Closest, TriangleTree
from meshreel.kernel.library import int32s
from meshreel.kernel.normals import surface_normals
from meshreel.kernel.order import opposite_sides
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.geometry.connectivity import boundary_edges, component_labels, lowest_connected
from meshreel.model.geometry.normals import face_normals, unit
from meshreel.model.sequence import Faces

Indices = npt.NDArray[np.int64]

NORMAL_WEIGHT = 0.04
"""Distance, in longest sides of the box of all frames, that counts as much as one radian between
normals."""

BEYOND_COSINE = 0.8
"""Cosine between the direction to a closest point on the boundary and its normal, below which a
point is beyond the surface: over a hole of a curved surface, the direction is not tangential."""

HIDDEN_DEPTH = 0.004
"""Depth below a surface, in longest sides of the box, at which faces of another direction are
hidden."""

CREASE_COSINE = 0.25
"""Cosine between the normals of two faces, below which their common side is a sharp crease."""

RIM_COSINE = 0.7
"""Mean cosine between the normals around a boundary and that of a surface across it, above which it
is the rim of a hole. At the end of a sleeve the mean is about 0."""

ON_SIDE = 1e-9
"""Points with a smaller barycentric coordinate are on a side."""


class Samples(NamedTuple):
    """Points of a surface.

    Attributes
    ----------
    faces : int64 array of shape (N,)
        The face that contains each point.
    weights : float64 array of shape (N, 3)
        Barycentric coordinates.
    points : float64 array of shape (N, 3)
    normals : float64 array of shape (N, 3)
    areas : float64 array of shape (N,)
        The part of the surface that each point represents.
    """

    faces: Indices
    weights: Floats
    points: Floats
    normals: Floats
    areas: Floats


@dataclass(frozen=True, eq=False)
class Connectivity:
    """What follows from the faces of a mesh alone, each property computed at most once.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
    """

    faces: Faces
    n_verts: int

    @cached_property
    def neighbors(self) -> Indices:
        """The face beyond each side of each face, or the face itself, of shape (3 M,)."""
        return np.asarray(opposite_sides(self.faces, self.n_verts).astype(np.int64) // 3)

    @cached_property
    def is_boundary(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex is on a side of only one face, of shape (V,)."""
        is_boundary = np.zeros(self.n_verts, bool)
        is_boundary[boundary_edges(self.faces)] = True
        return is_boundary


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh with properties that registration needs, each computed at most once.

    Attributes
    ----------
    vertices : float64 array of shape (V, 3)
    faces : int32 array of shape (M, 3)
    """

    vertices: Floats
    faces: Faces

    def moved(self, vertices: Floats) -> "TriangleMesh":
        """Return the mesh with other positions; both share their connectivity."""
        mesh = TriangleMesh(vertices, self.faces)
        vars(mesh)["_connectivity"] = self._connectivity
        return mesh

    @cached_property
    def _connectivity(self) -> Connectivity:
        return Connectivity(self.faces, len(self.vertices))

    @cached_property
    def _doubled_normals(self) -> Floats:
        return face_normals(self.vertices, self.faces)

    @cached_property
    def areas(self) -> Floats:
        """Area of each face, of shape (M,)."""
        return np.asarray(0.5 * np.linalg.norm(self._doubled_normals, axis=1))

    @cached_property
    def vertex_areas(self) -> Floats:
        """A third of the area of the faces of each vertex, of shape (V,)."""
        shares = np.repeat(self.areas / 3, 3)
        return np.asarray(np.bincount(self.faces.ravel(), shares, len(self.vertices)), np.float64)

    @cached_property
    def centroids(self) -> Floats:
        """Centroid of each face, of shape (M, 3)."""
        first, second, third = (self.vertices[corners] for corners in self.faces.T)
        return np.asarray((first + second + third) / 3)

    @cached_property
    def orientation(self) -> int:
        """1 if the normals point out of the enclosed volume, -1 if into it, 0 if it is open.

        A surface counts as open if its volume is less than a tenth of that of a sphere of its area.
        """
        centered = self.vertices[self.faces[:, 0]] - self.vertices.mean(axis=0)
        volume = _dots(centered, self._doubled_normals).sum() / 6
        sphere = self.areas.sum() ** 1.5 / (6 * np.pi**0.5)
        return int(np.sign(volume)) if abs(volume) > 0.1 * sphere else 0

    @cached_property
    def face_normals(self) -> Floats:
        """Unit normals of the faces, of shape (M, 3); zero without area."""
        return unit(self._doubled_normals)

    @cached_property
    def vertex_normals(self) -> Floats:
        """Unit normals of the vertices, of shape (V, 3)."""
        positions = np.ascontiguousarray(self.vertices[np.newaxis])
        return np.asarray(surface_normals(positions, int32s(self.faces))[0])

    @property
    def neighbors(self) -> Indices:
        """The face beyond each side of each face, or the face itself, of shape (3 M,)."""
        return self._connectivity.neighbors

    def cosines_across(self, neighbors: Indices) -> Floats:
        """Return the cosines between the normals of each face and of its `neighbors`."""
        return _dots(np.repeat(self.face_normals, 3, axis=0), self.face_normals[neighbors])

    @property
    def is_boundary(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex is on a side of only one face, of shape (V,)."""
        return self._connectivity.is_boundary

    @cached_property
    def boundaries(self) -> tuple[Floats, Floats]:
        """Lengths of the connected boundaries, and the areas of the components that they bound."""
        ends = boundary_edges(self.faces)
        if not len(ends):
            return np.empty(0), np.empty(0)
        _, first, loops = np.unique(
            lowest_connected(len(self.vertices), *ends.T)[ends[:, 0]],
            return_index=True,
            return_inverse=True,
        )
        lengths = np.linalg.norm(np.diff(self.vertices[ends], axis=1)[:, 0], axis=1)
        labels = component_labels(self.faces, len(self.vertices))
        areas = np.bincount(labels[self.faces[:, 0]], self.areas, len(self.vertices))
        lengths = np.bincount(loops, lengths, len(first)).astype(np.float64)
        return lengths, areas[labels[ends[first, 0]]]

    @cached_property
    def is_near_boundary(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex is on the boundary or next to it, of shape (V,)."""
        return with_rings(self.faces, self.is_boundary)

    @cached_property
    def is_outline(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex is on a boundary that is no rim of a hole, of shape (V,).

        An outline moves with the surface; a hole of a scan may travel over it.
        """
        if not self.is_boundary.any():
            return self.is_boundary
        sides = np.flatnonzero(self.neighbors == np.repeat(np.arange(len(self.faces)), 3))
        faces, corners = np.divmod(sides, 3)
        verts = self.faces.astype(np.int64)
        starts, ends = verts[faces, corners], verts[faces, (corners + 1) % 3]
        loops = lowest_connected(len(self.vertices), starts, ends)
        across, normals = np.zeros((2, len(self.vertices), 3))
        np.add.at(across, loops[starts], np.cross(self.vertices[ends], self.vertices[starts]))
        np.add.at(normals, loops[starts], self.vertex_normals[starts])
        n_verts = np.bincount(loops[starts], minlength=len(self.vertices))
        is_rim = _dots(unit(across), normals) > RIM_COSINE * n_verts
        return np.asarray(self.is_boundary & ~is_rim[loops])

    @cached_property
    def is_edge(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex is on an outline or a sharp crease, of shape (V,)."""
        is_edge = self.is_outline.copy()
        sides = np.flatnonzero(self.cosines_across(self.neighbors) < CREASE_COSINE)
        faces, corners = np.divmod(sides, 3)
        is_edge[self.faces[faces, corners]] = is_edge[self.faces[faces, (corners + 1) % 3]] = True
        return is_edge

    def ends_before(self, points: Floats, closest: Closest) -> npt.NDArray[np.bool_]:
        """Return whether each point is beyond the boundary of the surface, not above it."""
        if not self.is_boundary.any():
            return np.zeros(len(points), bool)
        sides = self.neighbors.reshape(-1, 3) == np.arange(len(self.faces))[:, None]
        is_on_side = np.roll(closest.weights, 1, axis=1) < ON_SIDE  # side k faces corner k + 2
        is_at_corner = closest.weights > 1 - ON_SIDE
        corners = self.is_boundary[self.faces[closest.faces]]
        is_on_boundary = (is_on_side & sides[closest.faces] | is_at_corner & corners).any(axis=1)
        heights = _dots(points - closest.points, self.face_normals[closest.faces])
        return np.asarray(is_on_boundary & (np.abs(heights) < BEYOND_COSINE * closest.distances))

    def encloses(self, points: Floats, closest: Closest) -> npt.NDArray[np.bool_]:
        """Return whether each point is below the closest component, which must be closed."""
        if not len(points):
            return np.zeros(0, bool)
        corners = self.faces[closest.faces]
        directions = np.einsum("nk,nkc->nc", closest.weights, self.vertex_normals[corners])
        is_below = self.orientation * _dots(points - closest.points, directions) < 0
        return np.asarray(is_below & self._is_closed[corners[:, 0]])

    @cached_property
    def _is_closed(self) -> npt.NDArray[np.bool_]:
        """Whether the component of each vertex has no boundary, of shape (V,)."""
        labels = component_labels(self.faces, len(self.vertices))
        return np.asarray(np.bincount(labels, self.is_boundary)[labels] == 0)

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree(self.vertices, self.faces)

    def closest(self, points: Floats) -> Closest:
        """Return the closest point of the surface for each point of shape (N, 3)."""
        return self._tree.closest(points)

    def corresponding(
        self, samples: Samples, min_cosine: float, reach: float
    ) -> tuple[Indices, Closest]:
        """Return the corresponding samples of another surface, and their closest points on this.

        These points are on faces with similar normals within reach. Samples deeper than
        `HIDDEN_DEPTH` below a face of another direction, as where bodies touch, do not correspond.
        """
        closest = self._tree.closest(samples.points)
        directions = samples.normals / min_cosine  # dot product >= 1 if normals are similar
        differs = _dots(self.face_normals[closest.faces], directions) < 1
        below = np.flatnonzero(differs & (closest.distances > HIDDEN_DEPTH))
        hidden = below[self.encloses(samples.points[below], closest.at(below))]
        closest.faces[closest.distances > reach] = closest.faces[hidden] = -1
        differs[hidden] = False
        # Most closest faces are similar: search by direction only for the other samples.
        unmatched = np.flatnonzero(differs)
        similar = self._tree.closest(samples.points[unmatched], directions[unmatched], reach)
        for values, matches in zip(closest, similar, strict=True):
            values[unmatched] = matches
        indices = np.flatnonzero(closest.faces >= 0)
        return indices, closest.at(indices)

    @cached_property
    def subdivisions(self) -> dict[float, "TriangleMesh"]:
        """Results of `refining.subdivided`, by their longest edge."""
        return {}

    def centroid_samples(self) -> Samples:
        """Return the centroids of the faces as samples."""
        weights = np.full((len(self.faces), 3), 1 / 3)
        return Samples(
            np.arange(len(self.faces)), weights, self.centroids, self.face_normals, self.areas
        )

    def vertex_samples(self) -> Samples:
        """Return the vertices as samples, each in one of its faces."""
        corners = np.zeros(len(self.vertices), np.int64)
        corners[self.faces.ravel()] = np.arange(self.faces.size)
        weights = np.eye(3)[corners % 3]
        return Samples(corners // 3, weights, self.vertices, self.vertex_normals, self.vertex_areas)

    @cached_property
    def oriented(self) -> Floats:
        """The vertices, and their normals times `NORMAL_WEIGHT`, of shape (V, 6)."""
        return np.hstack([self.vertices, NORMAL_WEIGHT * self.vertex_normals])

    @cached_property
    def oriented_tree(self) -> Any:
        """A k-d tree of `oriented`, which finds vertices that are near in place and direction."""
        return k_d_tree(self.oriented, balanced_tree=False)


def mean_at_vertices(values: Floats, of: Faces | Indices, n_verts: int) -> Floats:
    """Return the mean of values of faces or sides around each vertex, of shape (V,); else 0.

    `of` contains their K vertices, shape (N, K).
    """
    ends = of.ravel()
    sums = np.bincount(ends, np.repeat(values, of.shape[1]), n_verts)
    return np.asarray(sums / np.maximum(np.bincount(ends, minlength=n_verts), 1))


def with_rings(
    faces: Faces, is_chosen: npt.NDArray[np.bool_], n_rings: int = 1
) -> npt.NDArray[np.bool_]:
    """Return whether each vertex is chosen, or in rings of faces around those, of shape (V,)."""
    is_within = is_chosen.copy()
    for _ in range(n_rings):
        is_within[faces[is_within[faces].any(axis=1)]] = True
    return is_within


def _dots(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.einsum("nc,nc->n", first, second))
