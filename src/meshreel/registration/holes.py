"""Holes of scans: which faces of a registered mesh the raw frames show."""

from collections.abc import Iterable

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain
from meshreel.model.tracks import FACE_MASKS, Track
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import Tolerance, unsupported

SCANNED = FACE_MASKS[0]
"""Name of the track that is 1 for the faces that a raw frame has, otherwise 0."""


def scanned_faces(
    frames: Iterable[TriangleMesh],
    positions: Iterable[Floats],
    faces: Faces,
    tolerance: Tolerance,
) -> Track | None:
    """Return a track of which faces of a segment its raw frames show; None if they show all.

    A face becomes hidden if its centroid is unsupported and farther from the raw surface than the
    tolerance. It stays hidden while it is unsupported, so that rims of holes do not flicker.

    Parameters
    ----------
    frames : iterable of TriangleMesh
        Raw frames.
    positions : iterable of float64 arrays of shape (V, 3)
        The registered vertices of each frame.
    faces : int32 array of shape (M, 3)
    """
    is_scanned, hidden = [], np.zeros(len(faces), bool)
    for target, points in zip(frames, positions, strict=True):
        mesh, n_verts = TriangleMesh(points, faces), len(points)
        closest = target.closest(np.concatenate([points, mesh.centroids]))
        is_far = closest.distances[n_verts:] > tolerance.length
        is_unsupported = unsupported(mesh, target, closest, tolerance)[n_verts:]
        hidden = is_unsupported & (is_far | hidden)
        is_scanned.append(~hidden)
    return None if np.all(is_scanned) else Track(np.array(is_scanned), Domain.FACE)
