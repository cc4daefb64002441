"""FMPD: a perceptual error of the roughness of a mesh."""

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.metrics.reference import require_equal_frame_counts
from meshreel.model.geometry.connectivity import boundary_edges
from meshreel.model.geometry.normals import face_normals, unit
from meshreel.model.sequence import Faces, MeshSequence, single_segment

COTANGENTS = 0.001, 1000.0
"""Range of the halved cotangents."""

LEAST_ROUGHNESS = 0.0005

GREATEST_ROUGHNESS, MEANS = 0.2, 5.0
"""Roughness is clipped at the first, or at this many means of the smoother mesh if larger."""

EXPONENT = 0.15
"""Exponent of the visibility of roughness."""

ROUGH_SLOPE = 0.5
"""Slope beyond the mean roughness of the smoother mesh, where roughness masks errors."""

SCALE = 8.0
"""Factor of the difference, so that it spans 0 to 1."""


def fmpd(original: MeshSequence, decoded: MeshSequence) -> Floats:
    """FMPD of each frame: the difference in mean roughness, as it is perceived.

    Parameters
    ----------
    original, decoded : MeshSequence
        Of equal frame counts, each with constant faces, which may differ. 45 frames of 10,000
        vertices take about a second of processor time.

    Returns
    -------
    float64 array of shape (T,), 0 (equally rough, not necessarily equal) to 1

    Raises
    ------
    ConnectivityChangeError
        If the faces of a sequence change.
    InvalidInputError
        If frame counts differ, or a frame has no face with an area.

    References
    ----------
    K. Wang, F. Torkhani, A. Montanvert, "A fast roughness-based approach to the assessment of 3D
    mesh visual quality", Computers & Graphics 36(7), 2012. Constants are those of the authors'
    program; the results agree with it, except that it does not handle isolated vertices, which
    are excluded here.
    """
    pair = [single_segment(each, "FMPD") for each in (original, decoded)]
    require_equal_frame_counts(original, decoded, "FMPD compares equal numbers of frames")
    measures = [Roughness(each.faces, each.n_verts) for each in pair]
    values = np.empty(original.n_frames)
    for number in range(original.n_frames):
        both = []
        for measure, each, name in zip(measures, pair, ("original", "decoded"), strict=True):
            roughness, areas = measure.of(each.read(number, number + 1)[0])
            if not areas.any():
                raise InvalidInputError(
                    f"frame {number} of the {name} has no face with an area; FMPD needs one"
                )
            both.append((roughness, areas / areas.sum()))
        mean = min(float(roughness @ shares) for roughness, shares in both)
        first, second = (_perceived(roughness, mean) @ shares for roughness, shares in both)
        values[number] = min(SCALE * abs(first - second), 1.0)
    return values


class Roughness:
    """Roughness of the vertices of a mesh, frame by frame: the Laplacian of its curvature.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
    """

    def __init__(self, faces: Faces, n_verts: int) -> None:
        self._faces = faces
        self._flat_angles = np.full(n_verts, 2 * np.pi)
        self._flat_angles[boundary_edges(faces)] = np.pi

    def of(self, points: Floats) -> tuple[Floats, Floats]:
        """Roughness and area of each vertex, of shape (V,); both 0 for isolated vertices.

        Parameters
        ----------
        points : float array of shape (V, 3)
        """
        corners = points.astype(np.float64)[self._faces]
        sides = unit(np.roll(corners, -1, axis=1) - corners)
        cosines = -np.einsum("mki,mki->mk", sides, np.roll(sides, 1, axis=1))
        angles = np.arccos(np.clip(cosines, -1, 1))
        with np.errstate(divide="ignore"):
            cotangents = np.clip(0.5 / np.tan(angles), *COTANGENTS)
        curvature = np.abs(self._flat_angles - self._sums(self._faces, angles))
        # The cotangent at a corner weights the opposite edge, in both directions.
        nexts, lasts = np.roll(self._faces, -1, axis=1), np.roll(self._faces, 1, axis=1)
        both, weights = np.stack([nexts, lasts]), np.stack([cotangents] * 2)
        totals = self._sums(both, weights)
        around = self._sums(both, weights * curvature[both[::-1]])
        means = np.divide(around, totals, out=curvature.copy(), where=totals > 0)
        areas = np.linalg.norm(face_normals(points, self._faces), axis=1) / 6
        return np.abs(curvature - means), self._sums(self._faces, np.repeat(areas[:, None], 3, 1))

    def _sums(self, vertices: Faces, values: Floats) -> Floats:
        """Sums of values by vertex, of shape (V,)."""
        sums = np.bincount(vertices.ravel(), values.ravel(), len(self._flat_angles))
        return sums.astype(np.float64, copy=False)  # without entries, they are integers


def _perceived(roughness: Floats, threshold: float) -> Floats:
    """Visible roughness: a power, which rises less beyond a threshold."""
    greatest = max(GREATEST_ROUGHNESS, MEANS * threshold)
    offset = LEAST_ROUGHNESS**EXPONENT
    visible = np.clip(roughness, LEAST_ROUGHNESS, greatest) ** EXPONENT - offset
    turn = max(threshold, LEAST_ROUGHNESS) ** EXPONENT - offset
    return np.asarray(np.minimum(visible, turn + ROUGH_SLOPE * (visible - turn)))
