"""Cleaning of raw meshes: welded vertices, no degenerate faces, no small components."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values, rows_as_bytes
from meshreel.metrics.closest_points import k_d_tree
from meshreel.model.geometry.connectivity import boundary_edges, face_components, lowest_connected
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces, MeshFrame

Indices = npt.NDArray[np.int64]

MIN_COMPONENT_AREA = 0.002
"""Minimum area of a component to keep, as a share of the area of its frame."""

MAX_CRACK = 0.01
"""Largest distance, in tolerances, between vertices of a crack, which are welded."""

N_NEIGHBORS = 8
"""Number of nearest vertices, including itself, with which a vertex at a crack may be welded."""


class Removed(NamedTuple):
    """What cleaning a frame removed.

    Attributes
    ----------
    n_degenerate : int
        Number of faces without area.
    n_small_components : int
    n_welded : int
        Number of vertices that were welded at cracks.
    n_debris : int
        Number of components that are debris.
    debris_share : float
        Their share of the area.
    """

    n_degenerate: int = 0
    n_small_components: int = 0
    n_welded: int = 0
    n_debris: int = 0
    debris_share: float = 0.0


@dataclass(frozen=True, eq=False)
class CleanMesh:
    """A raw frame prepared for registration.

    Attributes
    ----------
    vertices : float64 array of shape (V, 3)
    faces : int32 array of shape (M, 3)
    raw_faces : int64 array of shape (M,)
        The number of each face in the raw frame.
    n_components : int
        Number of connected components; faces with a common vertex are connected.
    removed : Removed
    is_turned : bool
        Whether the corners of each face are in the reverse of their order in the raw frame.
    """

    vertices: Floats
    faces: Faces
    raw_faces: Indices
    n_components: int
    removed: Removed
    is_turned: bool = False

    @property
    def is_empty(self) -> bool:
        """Whether no face is left."""
        return not len(self.faces)

    def without(self, is_debris: npt.NDArray[np.bool_]) -> "CleanMesh":
        """Return the mesh without the faces of debris, given as an array of shape (M,)."""
        if not is_debris.any():
            return self
        n_debris = int(face_components(self.faces[is_debris], len(self.vertices)).max()) + 1
        areas = np.linalg.norm(face_normals(self.vertices, self.faces), axis=1)
        vertices, faces = compact(self.vertices, self.faces[~is_debris])
        return replace(
            self,
            vertices=vertices,
            faces=faces,
            raw_faces=self.raw_faces[~is_debris],
            n_components=self.n_components - n_debris,
            removed=self.removed._replace(
                n_debris=n_debris, debris_share=float(areas[is_debris].sum() / areas.sum())
            ),
        )

    def turned(self) -> "CleanMesh":
        """Return the mesh with its faces turned over."""
        faces = np.ascontiguousarray(self.faces[:, ::-1])
        return replace(self, faces=faces, is_turned=not self.is_turned)

    def reordered(self, values: Values) -> Values:
        """Return values at the three corners of faces, of shape (..., 3), in the other order.

        From the order of the raw corners to that of `faces`, or back.
        """
        return values[..., ::-1] if self.is_turned else values


def clean(frame: MeshFrame, max_removed_area: float = np.inf, max_crack: float = 0.0) -> CleanMesh:
    """Weld vertices, and remove faces without area and small components.

    Texture seams and quantization leave several vertices at one position, and rounding opens cracks
    between faces; welding restores the connectivity of the surface.

    Parameters
    ----------
    max_removed_area : float
        Largest area of a removed component, if that is less than `MIN_COMPONENT_AREA`.
    max_crack : float
        Vertices on boundaries are welded within this distance, others at equal positions.
    """
    _, first, inverse = np.unique(
        rows_as_bytes(frame.vertices + 0), return_index=True, return_inverse=True
    )
    vertices = frame.vertices[first].astype(np.float64)
    faces: Faces = inverse[frame.faces].astype(np.int32)
    n_distinct = len(np.unique(roots := _roots_at_cracks(vertices, faces, max_crack)))
    faces = roots[faces]
    doubled_areas = np.linalg.norm(face_normals(vertices, faces), axis=1)
    has_area = doubled_areas > 0
    face_numbers = np.flatnonzero(has_area)
    labels = face_components(faces[face_numbers], len(vertices))
    areas = np.bincount(labels, doubled_areas[face_numbers])
    is_large = areas >= min(MIN_COMPONENT_AREA * areas.sum(), max_removed_area)
    face_numbers = face_numbers[is_large[labels]]
    return CleanMesh(
        *compact(vertices, faces[face_numbers]),
        face_numbers,
        int(is_large.sum()),
        Removed(int((~has_area).sum()), int((~is_large).sum()), len(vertices) - n_distinct),
    )


def compact(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Return the vertices that faces use, and the faces with their new numbers."""
    used, corners = np.unique(faces, return_inverse=True)
    return vertices[used], corners.reshape(-1, 3).astype(np.int32)


def _roots_at_cracks(vertices: Floats, faces: Faces, max_crack: float) -> Faces:
    """Return the vertex that replaces each vertex, of shape (V,): itself, except at cracks.

    Boundary vertices that are connected by distances up to `max_crack` are replaced by the lowest,
    unless they extend over more than twice that distance, as the outline of a fine mesh does.
    """
    roots = np.arange(len(vertices), dtype=np.int32)
    rim = np.unique(boundary_edges(faces))
    if not (max_crack and len(rim)):
        return roots
    points = vertices[rim]
    _, near = k_d_tree(points).query(points, N_NEIGHBORS, distance_upper_bound=max_crack)
    first, column = np.nonzero(near < len(rim))  # it is len(rim) where there is no neighbor
    lowest = lowest_connected(len(rim), first, near[first, column])
    order = np.argsort(lowest, kind="stable")
    starts = np.flatnonzero(np.diff(lowest[order], prepend=-1))
    low, high = (bound.reduceat(points[order], starts) for bound in (np.minimum, np.maximum))
    is_small = np.zeros(len(rim), bool)
    is_small[lowest[order[starts]]] = np.linalg.norm(high - low, axis=1) <= 2 * max_crack
    roots[rim] = rim[np.where(is_small[lowest], lowest, np.arange(len(rim)))]
    return roots
