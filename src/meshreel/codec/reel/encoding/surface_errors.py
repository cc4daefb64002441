"""Weights of errors that let vertices slide along the surface: an encoder's choice.

Vertices that slide along a surface do not change its shape; in a registered capture, only the shape
matters. Errors in two of three dimensions then have small weights, so coarser values suffice.
"""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.codec.reel.encoding.block_frames import CHUNK_VERTICES, BlockFrames
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.predict import MAX_JOINT
from meshreel.model.frame_choice import evenly_spaced
from meshreel.model.geometry.normals import face_normals, unit
from meshreel.model.sequence import Faces
from meshreel.runtime.threads import chunks

ACROSS = 0.5
"""Weight of a squared error across the surface relative to that of an error without direction.
Measured together with `ALONG`, by bits at equal surface PSNR and at equal normals."""

ALONG = 0.0025
"""Weight of a squared error along the surface; it increases where the surface bends."""

SLIDING_STEP = 0.84
"""Step relative to that without sliding, for about the same surface PSNR."""

MIN_STRENGTH = 20.0
"""Minimum root mean square, in steps, of fields that are quantized jointly. Residuals of weaker
fields are mostly zero; correcting other errors with them would cost more than it saves."""

MAX_TIMES = 8
"""Maximum number of frames whose normals are used."""


def surface_forms(
    vectors: Floats, fields: Floats, frames: BlockFrames, mesh: FieldMesh, n_learned: int
) -> npt.NDArray[np.float32] | None:
    """Return quadratic forms of the errors of strong modes, as `kernel.predict` needs them.

    The error of a vertex is measured by its squared distances from the planes of the adjacent
    faces, as in quadric error metrics (Garland and Heckbert, 1997).

    Parameters
    ----------
    vectors : float64 array of shape (3, T, K)
        Basis vectors of the modes.
    fields : float64 array of shape (V, K)
        In steps.
    n_learned : int
        Number of modes to which the prediction weights adapt; others are not quantized jointly.

    Returns
    -------
    float32 array of shape (V, n (n + 1) / 2)
        For the first n modes, with vertices in coding order; None if no mode is strong.
    """
    is_weak = np.square(fields).mean(axis=0) < MIN_STRENGTH**2
    n_strong = int(np.argmax(is_weak)) if is_weak.any() else len(is_weak)
    n_joint = min(n_strong, n_learned, MAX_JOINT)
    if not n_joint:
        return None
    times = evenly_spaced(frames.n_frames, MAX_TIMES)
    twins = opposite_sides(mesh.faces, frames.n_verts)
    boundary = np.flatnonzero(twins == np.arange(len(twins)))
    squares = [
        _squared_normals(frames.internal_frame(time), mesh.faces, boundary) for time in times
    ]
    weight = (ACROSS - ALONG) * frames.n_frames / len(times)
    rows, columns = np.tril_indices(n_joint)
    result = np.empty((frames.n_verts, len(rows)), np.float32)
    for piece in chunks(frames.n_verts, CHUNK_VERTICES):
        forms = np.tile(ALONG * np.eye(n_joint), (piece.stop - piece.start, 1, 1))
        for time, of_time in zip(times, squares, strict=True):
            axes = vectors[:, time, :n_joint]
            forms += weight * np.einsum("ik,vij,jl->vkl", axes, of_time[piece], axes, optimize=True)
        # With both axes reversed, Cholesky factors eliminate the last mode first.
        factors = np.linalg.cholesky(forms[:, ::-1, ::-1])[:, ::-1, ::-1].swapaxes(1, 2)
        scales = np.diagonal(factors, axis1=1, axis2=2)[:, :, np.newaxis]
        lower = factors / scales
        lower[:, range(n_joint), range(n_joint)] = scales[:, :, 0] ** 2
        result[mesh.number[piece]] = lower[:, rows, columns]
    return result


def _squared_normals(
    positions: npt.NDArray[np.floating], faces: Faces, boundary: Integers
) -> npt.NDArray[np.float32]:
    """Return the mean products of the normals around each vertex, of shape (V, 3, 3).

    Faces are weighted by area. A boundary side is weighted as a square perpendicular to its face,
    so that it does not move. Without faces, all directions have equal weights.

    Parameters
    ----------
    boundary : integer array of shape (B,)
        Sides of faces that no other face shares; side 3 m + k of face m begins at its corner k.
    """
    points, n_verts = positions.astype(np.float64), len(positions)
    normals = face_normals(points, faces)
    owners, corners = np.divmod(boundary, 3)
    starts, ends = faces[owners, corners], faces[owners, (corners + 1) % 3]
    along = points[ends] - points[starts]
    across = np.cross(along, unit(normals[owners])) * np.linalg.norm(along, axis=1)[:, np.newaxis]
    vertices = np.concatenate([faces.ravel(), starts, ends])
    normals = np.concatenate([np.repeat(normals, 3, axis=0), across, across])
    areas = np.linalg.norm(normals, axis=1)
    units = unit(normals)

    def sums(values: Floats) -> Floats:
        return np.bincount(vertices, values, n_verts).astype(np.float64)

    total = sums(areas)
    squares = np.empty((n_verts, 3, 3), np.float32)
    for i in range(3):
        for j in range(i + 1):
            product = sums(areas * units[:, i] * units[:, j])
            squares[:, i, j] = squares[:, j, i] = product / np.where(total > 0, total, 1.0)
    squares[total <= 0] = np.eye(3)
    return squares
