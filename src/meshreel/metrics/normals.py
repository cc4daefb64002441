"""Angles between the normals of original and decoded faces."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.metrics.reference import paired_frames, shared_reference
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces, Vertices

DEGENERATE_AREA = 1e-14
"""Faces up to this area, in squared diagonals of the original, have no normal."""


@dataclass(frozen=True)
class NormalAngles:
    """Angles between face normals over all frames."""

    mean_deg: float
    p95_deg: float
    """Mean and 95th percentile over all faces and frames; 0 if all are degenerate."""
    n_degenerate_face_frames: int
    """Excluded faces, summed over the frames: the original or the decoded face has no area."""


@np.errstate(over="ignore", invalid="ignore")
def normal_angles(original: Vertices, decoded: Vertices, faces: Faces) -> NormalAngles:
    """Mean and 95th percentile of the angle between original and decoded face normals.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite
    faces : integer array of shape (M, 3)

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    reference = shared_reference(original, decoded)
    smallest_area = DEGENERATE_AREA * reference.diagonal_scaled**2
    angles, n_angles = np.empty(len(original) * len(faces)), 0
    for frame, displacement in paired_frames(original, decoded, reference):
        frame_angles, valid = face_angles_deg(frame, frame + displacement, faces, smallest_area)
        n_valid = int(np.count_nonzero(valid))
        angles[n_angles : n_angles + n_valid] = frame_angles[valid]
        n_angles += n_valid
    n_degenerate = len(angles) - n_angles
    if n_angles == 0:
        return NormalAngles(0.0, 0.0, n_degenerate)
    angles = angles[:n_angles]
    mean_deg = float(angles.mean())  # before the percentile, which reorders in place
    p95_deg = float(np.percentile(angles, 95, overwrite_input=True))
    return NormalAngles(mean_deg, p95_deg, n_degenerate)


def face_angles_deg(
    frame: Floats, frame_hat: Floats, faces: Faces, smallest_area: float
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Angles of shape (M,), and a mask of the valid ones: both faces have an area."""
    normals, normals_hat = face_normals(frame, faces), face_normals(frame_hat, faces)
    lengths = _lengths(normals)
    lengths_hat = _lengths(normals_hat)
    valid = np.minimum(lengths, lengths_hat) > 2 * smallest_area
    # atan2 preserves small angles, which an arc cosine would round to 0.
    sines = _lengths(np.cross(normals, normals_hat))
    cosines = np.einsum("ma,ma->m", normals, normals_hat)
    angles = np.degrees(np.arctan2(sines, cosines))
    return angles, valid & np.isfinite(angles)


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("ma,ma->m", vectors, vectors)))
