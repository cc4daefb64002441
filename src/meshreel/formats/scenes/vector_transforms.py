"""Transformation of vectors and normals to world space, with row vectors as in USD and Alembic."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values

Matrix = npt.NDArray[np.float64]


def transform_vectors(values: Values, matrix: Matrix) -> Values:
    """Rotate and scale vectors of shape (N, 3) by the linear part of a transform."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3:
        return values
    with np.errstate(all="ignore"):
        result: Values = (values.astype(np.float64) @ linear).astype(values.dtype)
    return result


def transform_normals(values: Values, matrix: Matrix) -> Values:
    """Transform normals of shape (N, 3) by the inverse transpose, keeping their lengths."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3 or not np.isfinite(linear).all():
        return values
    with np.errstate(all="ignore"):
        normals = values.astype(np.float64)
        result = normals @ np.linalg.pinv(linear).T
        lengths, before = (np.linalg.norm(one, axis=1, keepdims=True) for one in (result, normals))
        result *= np.where(lengths > 0, before / lengths, 1)
    found: Values = result.astype(values.dtype)
    return found
