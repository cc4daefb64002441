"""Per-vertex error fields of one frame, for heat maps."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.kernel.closest import TriangleTree
from meshreel.metrics.normals import DEGENERATE_AREA, face_angles_deg
from meshreel.metrics.reference import Reference, paired_frames, shared_reference
from meshreel.metrics.sted import LocalSted
from meshreel.model.sequence import Faces

Frame = npt.NDArray[np.floating]
Field = Callable[[Frame, Frame], Floats]
"""Maps original and decoded positions of a frame, of shape (V, 3), to a value of each decoded
vertex."""


@dataclass(frozen=True)
class Heat:
    """Label of an error field, and the unit printed after its values."""

    label: str
    unit: str


HEATS = {
    "distance": Heat("vertex distance, % of the diagonal", "%"),
    "angle": Heat("angle between normals, degrees", "degrees"),
    "sted": Heat("local STED: deviation of relative edge lengths", ""),
}

SURFACE_HEAT = Heat("distance to the original surface, % of the diagonal", "%")
"""Replaces the vertex distance if the meshes differ."""


def heat_field(kind: str, faces: Faces, n_verts: int, diagonal: float) -> Field:
    """Return the error field of a kind; data that all frames share is computed once.

    Parameters
    ----------
    kind : str
        One of `HEATS`.
    faces : integer array of shape (M, 3)
    diagonal : float
        Diagonal of the bounding box of the whole original sequence, in model units.

    Raises
    ------
    InvalidInputError
        If the kind is unknown.
    """
    if kind == "distance":
        return lambda original, decoded: vertex_distance_percent(original, decoded, diagonal)
    if kind == "angle":
        return lambda original, decoded: vertex_normal_angle_deg(original, decoded, faces)
    if kind == "sted":
        local = LocalSted(faces, n_verts)
        return local.field
    raise InvalidInputError(f"heat must be one of {', '.join(HEATS)}; got {kind!r}")


def vertex_distance_percent(original: Frame, decoded: Frame, diagonal: float) -> Floats:
    """Distance of each decoded vertex from its original, in percent of a diagonal, shape (V,).

    If the diagonal is 0, every distance above 0 is infinite.

    Parameters
    ----------
    original, decoded : float arrays of shape (V, 3), in model units, all finite
    diagonal : float
        Diagonal of the bounding box of the whole original sequence, in model units.

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    reference = shared_reference(original[np.newaxis], decoded[np.newaxis])
    pairs = paired_frames(original[np.newaxis], decoded[np.newaxis], reference)
    _, displacement = next(pairs)
    distances = np.sqrt(np.einsum("va,va->v", displacement, displacement)) / reference.scale
    infinite = np.where(distances > 0, np.inf, 0.0)
    return np.asarray(np.divide(100 * distances, diagonal, out=infinite, where=diagonal > 0))


def surface_distance_percent(
    original: Frame, decoded: Frame, faces: Faces, faces_hat: Faces, reference: Reference
) -> Floats:
    """Distance of each decoded vertex from the original surface, in percent of the diagonal.

    Parameters
    ----------
    original : float array of shape (V, 3), in model units, finite
    decoded : float array of shape (W, 3), in model units, finite
    faces, faces_hat : integer arrays of shape (M, 3)
        Faces of the original, at least one, and of the decoded mesh.
    reference : Reference
        Of the whole original sequence. If its diagonal is 0, every distance above 0 is infinite.

    Returns
    -------
    float64 array of shape (W,), NaN for vertices that no face uses
    """
    tree = TriangleTree(reference.apply(original), faces)
    used_verts = np.unique(faces_hat)
    distances = tree.closest(reference.apply(decoded[used_verts])).distances
    diagonal = reference.diagonal_scaled
    infinite = np.where(distances > 0, np.inf, 0.0)
    percents = np.full(len(decoded), np.nan)
    percents[used_verts] = np.divide(100 * distances, diagonal, out=infinite, where=diagonal > 0)
    return percents


@np.errstate(over="ignore", invalid="ignore")
def vertex_normal_angle_deg(original: Frame, decoded: Frame, faces: Faces) -> Floats:
    """Mean angle between original and decoded normals around each vertex, in degrees, shape (V,).

    Averages the incident faces that are degenerate in neither mesh; 0 without such a face.

    Parameters
    ----------
    original, decoded : float arrays of shape (V, 3), in model units, all finite
    faces : integer array of shape (M, 3)

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    reference = shared_reference(original[np.newaxis], decoded[np.newaxis])
    smallest_area = DEGENERATE_AREA * reference.diagonal_scaled**2
    pair = reference.apply(original), reference.apply(decoded)
    angles, valid = face_angles_deg(*pair, faces, smallest_area)
    corners, n_verts = faces[valid].ravel(), len(original)
    sums = np.bincount(corners, np.repeat(angles[valid], 3), n_verts)
    counts = np.bincount(corners, minlength=n_verts)
    return np.divide(sums, counts, out=np.zeros(n_verts), where=counts > 0)
