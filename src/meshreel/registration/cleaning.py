"""Cleaning of raw meshes: welded vertices, no degenerate faces, no small components."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, rows_as_bytes
from meshreel.model.geometry.connectivity import component_labels
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces, MeshFrame

Indices = npt.NDArray[np.int64]

MIN_COMPONENT_AREA = 0.002
"""Minimum area of a component to keep, as a share of the area of its frame."""


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
    n_degenerate : int
        Number of removed faces without area.
    n_small_components : int
        Number of removed components.
    """

    vertices: Floats
    faces: Faces
    raw_faces: Indices
    n_components: int
    n_degenerate: int
    n_small_components: int

    @property
    def is_empty(self) -> bool:
        """Whether no face is left."""
        return not len(self.faces)


def clean(frame: MeshFrame, max_removed_area: float = np.inf) -> CleanMesh:
    """Weld equal positions, and remove faces without area and small components.

    Texture seams and quantization leave several vertices at one position; welding them restores
    the connectivity of the surface.

    Parameters
    ----------
    max_removed_area : float
        Largest area of a removed component, if that is less than `MIN_COMPONENT_AREA`.
    """
    _, first, inverse = np.unique(
        rows_as_bytes(frame.vertices + 0), return_index=True, return_inverse=True
    )
    vertices = frame.vertices[first].astype(np.float64)
    faces: Faces = inverse[frame.faces].astype(np.int32)
    doubled_areas = np.linalg.norm(face_normals(vertices, faces), axis=1)
    has_area = doubled_areas > 0
    face_numbers = np.flatnonzero(has_area)
    component = component_labels(faces[face_numbers], len(vertices))
    labels, face_components = np.unique(component[faces[face_numbers, 0]], return_inverse=True)
    areas = np.bincount(face_components, doubled_areas[face_numbers], len(labels))
    is_large = areas >= min(MIN_COMPONENT_AREA * areas.sum(), max_removed_area)
    face_numbers = face_numbers[is_large[face_components]]
    used_vertices, corners = np.unique(faces[face_numbers], return_inverse=True)
    return CleanMesh(
        vertices[used_vertices],
        corners.reshape(-1, 3).astype(np.int32),
        face_numbers,
        int(is_large.sum()),
        int((~has_area).sum()),
        int((~is_large).sum()),
    )
