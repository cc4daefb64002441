"""How finely a surface is coded because it is smooth: an encoder's choice.

An error of the normals is seen against how much these turn from face to face anyway: what is lost
among the facets of a scan is a dent in a cloth. So the step of a quality is finer on surfaces that
are smoother than those on which qualities were judged. docs/codec.md, "What a quality means".
"""

import numpy as np
import numpy.typing as npt

from meshreel.codec.connectivity.triangles import twin_sides
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces
from meshreel.runtime.profiling import staged

Vertices = npt.NDArray[np.floating]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

USUAL_BEND_DEG = 8.0
"""Mean turn of normals across edges from which on steps are as usual: the nine sequences of
`docs/codec.md` have 9 to 28 degrees."""

POWER = 1.5
"""Of the step by the turn. Errors of normals fall more slowly than the step, nearly as its root
where modes fade slowly."""

LEAST_SHARE = 0.2
"""Of the usual step, however smooth: normals then are off by less than is seen on a plain wall."""

MOST_EDGES = 4096
N_FRAMES = 4
"""Samples that the turn is found from."""


def sampled_frames(n_frames: int) -> list[int]:
    """Numbers of the frames that are looked at: in the middle of equal parts."""
    return sorted({n_frames * (2 * part + 1) // (2 * N_FRAMES) for part in range(N_FRAMES)})


@staged("smoothness")
def step_share(faces: Faces, n_verts: int, frames: Vertices) -> float:
    """The step for a surface by the usual one of a quality, `LEAST_SHARE` to 1.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    n_verts : int
    frames : float array of shape (T, V, 3)
    """
    twins = twin_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))
    sides = sides[:: max(1, len(sides) // MOST_EDGES)]
    found = _turns_deg(faces, sides, twins[sides], frames)
    if not len(found):
        return 1.0
    share = (float(found.mean()) / USUAL_BEND_DEG) ** POWER
    return float(np.clip(share, LEAST_SHARE, 1.0))


def _turns_deg(faces: Faces, sides: Integers, twins: Integers, frames: Vertices) -> Floats:
    """Angles between the normals on both sides of some edges, where both faces have an area."""
    corners = faces.reshape(-1)
    is_turned = corners[sides] == corners[twins]
    with np.errstate(over="ignore", invalid="ignore"):  # of huge coordinates, which do not count
        both = face_normals(frames, faces[np.concatenate([sides, twins]) // 3])
        first, second = np.split(both, 2, axis=1)
        first, second = first.reshape(-1, 3), second.reshape(-1, 3)
        signs = np.tile(np.where(is_turned, -1.0, 1.0), len(frames))
        cosines = np.einsum("ij,ij->i", first, second) * signs
        lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        has_area = (lengths > 0) & np.isfinite(lengths)
    turns = np.clip(cosines[has_area] / lengths[has_area], -1.0, 1.0)
    return np.asarray(np.degrees(np.arccos(turns)))
