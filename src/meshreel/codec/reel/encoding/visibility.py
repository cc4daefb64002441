"""The quantization step of a quality: an encoder's choice.

A quality sets errors of positions and normals that look alike on all sequences: at the
default, a model as high as a full screen looks like its original. How large the errors of a step
are depends on the number of modes; how visible they are, on the sizes of the faces and on the
angles between them. docs/codec.md, "What the user sets", has the measurements.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats, Vertices
from meshreel.codec.targets import error_scale
from meshreel.kernel.order import opposite_sides
from meshreel.model.frame_choice import evenly_spaced
from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces

POSITION_ERROR = 4.5e-4
"""RMS error of positions at the default quality, in diagonals of the model; less than half a pixel
if the model is as high as a screen of 1080 lines."""

NORMAL_ERROR_DEG, NORMAL_ERROR_PER_BEND = 0.2, 0.15
"""Mean error of normals at the default quality, in degrees: on a flat surface, and its increase per
degree of the mean angle between adjacent faces, because bends hide errors."""

MAX_BEND_DEG = 20.0
"""Larger angles are clipped to this: a hard edge does not hide errors on adjacent flat faces."""

SEAM_ERROR, MIN_SEAM_SHARE = 1.3e-4, 0.1
"""RMS error of positions at the default quality if more than a share of the vertices coincide with
others, because larger errors open cracks."""

SMOOTH_ERRORS, ROUGH_ERRORS = 0.35, 0.40
"""Errors of normals relative to those from independent errors of vertices. Modes lead to smoother
errors, the rounding of few frames does not: the second number is divided by the frames."""

ERROR_OF_MODES = 1.9
"""Squared error of modes relative to plain rounding: small coefficients become zero."""

MAX_BLOCKS, MAX_FRAMES, MAX_VERTICES = 4, 128, 768
"""Samples for modes: blocks, and frames and vertices of a block."""

N_FRAMES, MAX_SIDES = 2, 1024
"""Samples for normals: frames of a block, and sides of faces."""


class Steps(NamedTuple):
    """Quantization steps of a quality, in model units."""

    modes: float
    """Step of modes: the finest that a block needs; with one frame, equal to `grid`."""
    grid: float
    """Step of positions that are rounded to a grid."""


def steps_of_quality(
    quality: float, faces: Faces, blocks: Iterable[Vertices], model_size: float
) -> Steps:
    """Return the quantization steps of a quality.

    Parameters
    ----------
    quality : float
        1 to 100.
    faces : int32 array of shape (M, 3)
    blocks : iterable of float arrays of shape (T_b, V, 3)
        Some of the blocks that will be coded, with vertices in the order of the faces.
    model_size : float
        Mean diagonal of the bounding boxes of frames, in model units.
    """
    frames, variances, n_frames, scale = [], [], 0, error_scale(quality)
    for block in blocks:
        n_frames, n_verts = max(n_frames, len(block)), block.shape[1]
        frames.append(block[evenly_spaced(len(block), N_FRAMES)].astype(np.float64) / model_size)
        times = evenly_spaced(len(block), MAX_FRAMES)
        vertices = evenly_spaced(n_verts, MAX_VERTICES)
        sampled = block[np.ix_(times, vertices)].astype(np.float64) / model_size
        rows = (sampled - sampled[0, 0]).transpose(0, 2, 1).reshape(-1, sampled.shape[1])
        if rows.shape[0] > rows.shape[1]:
            rows = rows.T
        squares = np.sort(np.maximum(np.linalg.eigvalsh(rows @ rows.T), 0.0))
        variances.append(squares / (len(times) * len(vertices)))
    surface = SampledSurface(faces, np.concatenate(frames))
    # A grid rounds three coordinates, and coincident vertices equally, so seams do not matter.
    grid = 2.0 * surface.allowed_error(1) * scale * model_size
    if n_frames == 1:
        return Steps(grid, grid)
    error = surface.allowed_error(n_frames)
    if surface.has_seams:
        error = min(error, SEAM_ERROR)
    error *= scale
    rounded_vectors = 3.0 * n_frames / n_verts
    allowed = error**2 / (ERROR_OF_MODES * (1.0 + rounded_vectors))
    mode_error = min(_rounding_error(allowed, of_block) for of_block in variances)
    return Steps(float(np.sqrt(12.0 * mode_error)) * model_size or 2.0 * error * model_size, grid)


def _rounding_error(allowed: float, variances: Floats) -> float:
    """Return the squared error of each mode with which all modes together have the allowed one.

    A mode adds this error, or its own variance if that is smaller: "reverse water-filling" (Cover
    and Thomas, Elements of Information Theory, 10.3.3).

    Parameters
    ----------
    variances : float64 array of shape (K,)
        In ascending order.
    """
    sums = np.cumsum(variances) + np.arange(len(variances))[::-1] * variances
    return float(np.interp(allowed, np.append(0.0, sums), np.append(0.0, variances)))


class SampledSurface:
    """The visibility of errors, measured at sampled sides of faces in sampled frames.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    frames : float64 array of shape (T, V, 3)
    """

    normals_per_error: float = 0.0
    """Error of normals in degrees per RMS error of positions, if those of vertices are independent:
    the mean of sqrt(sum of squared sides / 3) over twice the area, weighted with the area."""
    bend_deg: float = MAX_BEND_DEG
    """Mean angle between adjacent faces."""
    has_seams: bool
    """Whether many vertices at open sides coincide, so that errors open cracks."""

    def __init__(self, faces: Faces, frames: Floats) -> None:
        twins = opposite_sides(faces, frames.shape[1])
        is_open = twins == np.arange(len(twins))
        ends = frames[0, np.unique(faces.ravel()[is_open])]
        n_coincident = len(ends) - len(np.unique(ends.view("V24")))
        self.has_seams = n_coincident > MIN_SEAM_SHARE * frames.shape[1]
        sides = np.random.default_rng(0).permutation(len(twins))[:MAX_SIDES]
        twins = twins[sides]
        adjacent = face_normals(frames, faces[np.concatenate([sides, twins]) // 3])
        normals, others = np.split(adjacent, 2, axis=1)
        areas, other_areas = (np.linalg.norm(vectors, axis=2) for vectors in (normals, others))
        if not areas.any():
            return
        corners = frames[:, faces[sides // 3]]
        squares = np.square(corners - np.roll(corners, 1, axis=2)).sum(axis=(2, 3))
        self.normals_per_error = float(np.degrees(np.sqrt(squares / 3.0).sum() / areas.sum()))
        is_flipped = faces.ravel()[sides] == faces.ravel()[twins]
        cosines = np.einsum("tsc,tsc->ts", normals, others) * np.where(is_flipped, -1.0, 1.0)
        has_angle = (areas * other_areas > 0) & (twins != sides)
        if has_angle.any():
            cosines = cosines[has_angle] / (areas * other_areas)[has_angle]
            bends = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
            self.bend_deg = float(np.minimum(bends, MAX_BEND_DEG).mean())

    def allowed_error(self, n_frames: int) -> float:
        """Return the RMS error of positions at the default quality, in diagonals of the model."""
        limit = NORMAL_ERROR_DEG + NORMAL_ERROR_PER_BEND * self.bend_deg
        normals = self.normals_per_error * (SMOOTH_ERRORS + ROUGH_ERRORS / n_frames)
        return min(POSITION_ERROR, limit / normals) if normals > 0 else POSITION_ERROR
