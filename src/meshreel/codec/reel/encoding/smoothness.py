"""Finer quantization of smooth surfaces: an encoder's choice.

Errors of normals are visible relative to how much normals change from face to face: an error that
is invisible among the facets of a scan is a dent in a cloth. So the step of a quality is finer on
surfaces smoother than those on which qualities were judged. docs/codec.md, "What the user sets".
"""

import numpy as np
import numpy.typing as npt

from meshreel.codec.connectivity.triangles import twin_sides
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces

Vertices = npt.NDArray[np.floating]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

USUAL_BEND_DEG = 8.0
"""Mean angle between normals across edges above which the step is not reduced; the nine sequences
of `docs/codec.md` have 9 to 28 degrees."""

POWER = 1.5
"""Exponent of the step as a function of the angle. Errors of normals fall more slowly than the
step, nearly as its root if modes fade slowly."""

MIN_SHARE = 0.2
"""Smallest factor of the step; errors of normals are then invisible even on a flat wall."""

MAX_EDGES = 4096
N_FRAMES = 4
"""Samples for the mean angle."""


def sampled_frames(n_frames: int) -> list[int]:
    """Return the frames to sample: the middles of equal parts."""
    return sorted({n_frames * (2 * part + 1) // (2 * N_FRAMES) for part in range(N_FRAMES)})


def step_share(faces: Faces, n_verts: int, frames: Vertices) -> float:
    """Return the factor of the step for a surface, `MIN_SHARE` to 1.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    frames : float array of shape (T, V, 3)
    """
    twins = twin_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))
    sides = sides[:: max(1, len(sides) // MAX_EDGES)]
    angles = _angles_deg(faces, sides, twins[sides], frames)
    if not len(angles):
        return 1.0
    share = (float(angles.mean()) / USUAL_BEND_DEG) ** POWER
    return float(np.clip(share, MIN_SHARE, 1.0))


def _angles_deg(faces: Faces, sides: Integers, twins: Integers, frames: Vertices) -> Floats:
    """Return the angles between the normals on both sides of edges whose faces have an area."""
    corners = faces.reshape(-1)
    is_flipped = corners[sides] == corners[twins]
    with np.errstate(over="ignore", invalid="ignore"):  # huge coordinates are excluded below
        both = face_normals(frames, faces[np.concatenate([sides, twins]) // 3])
        first, second = both[:, : len(sides)], both[:, len(sides) :]
        cosines = np.einsum("tij,tij->ti", first, second) * np.where(is_flipped, -1.0, 1.0)
        lengths = np.linalg.norm(first, axis=2) * np.linalg.norm(second, axis=2)
        has_area = (lengths > 0) & np.isfinite(lengths)
    turns = np.clip(cosines[has_area] / lengths[has_area], -1.0, 1.0)
    return np.asarray(np.degrees(np.arccos(turns)))
