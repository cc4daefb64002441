"""Transformation of points, vectors and normals by matrices for row vectors."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Vertices


def transform_points(points: Vertices, matrices: Floats) -> Vertices:
    """Return points transformed by each matrix, of shape (I * V, 3).

    They are computed in float64 and rounded once to the type of `points`. The result stays float64
    if it is so far from the origin that rounding would move a vertex by more than a millionth of
    the size of the result.

    Parameters
    ----------
    points : float array of shape (V, 3)
    matrices : float64 array of shape (4, 4) or (I, 4, 4)
    """
    if np.array_equal(matrices, np.eye(4)):
        return points
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        linear, shift = matrices[..., :3, :3], matrices[..., np.newaxis, 3, :3]
        world: Vertices = (points.astype(np.float64) @ linear + shift).reshape(-1, 3)
        narrowing = Narrowing()
        narrowing.add(world)
        dtype: Any = points.dtype if narrowing.is_harmless else np.float64
        vertices: Vertices = world.astype(dtype)
    return vertices


def transform_vectors(values: Values, matrix: Floats) -> Values:
    """Rotate and scale vectors of shape (N, 3) by the linear part of a transform."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3:
        return values
    with np.errstate(all="ignore"):
        vectors: Values = (values.astype(np.float64) @ linear).astype(values.dtype)
    return vectors


def transform_normals(values: Values, matrix: Floats) -> Values:
    """Transform normals of shape (N, 3) by the inverse transpose, keeping their lengths."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3 or not np.isfinite(linear).all():
        return values
    with np.errstate(all="ignore"):
        before = values.astype(np.float64)
        after = before @ np.linalg.pinv(linear).T
        lengths, wanted = (np.linalg.norm(one, axis=1, keepdims=True) for one in (after, before))
        normals: Values = (after * np.where(lengths > 0, wanted / lengths, 1)).astype(values.dtype)
    return normals


def is_mirroring(matrices: Floats) -> npt.NDArray[np.bool_]:
    """Return which transforms, of shape (..., 4, 4), reverse orientation."""
    with np.errstate(all="ignore"):
        mirrors: npt.NDArray[np.bool_] = np.linalg.det(matrices[..., :3, :3]) < 0
    return mirrors
