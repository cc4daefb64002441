"""Vectors of a mesh as a transform to the world turns them; positions are rows on its left."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values

Matrix = npt.NDArray[np.float64]


def turned_vectors(values: Values, matrix: Matrix) -> Values:
    """Vectors of shape (N, 3) as a transform to the world turns and scales them."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3:
        return values
    with np.errstate(all="ignore"):
        turned: Values = (values.astype(np.float64) @ linear).astype(values.dtype)
    return turned


def turned_normals(values: Values, matrix: Matrix) -> Values:
    """Normals of shape (N, 3) as those of the transformed surface, of the length that they had."""
    linear = matrix[:3, :3]
    if np.array_equal(linear, np.eye(3)) or values.shape[1] != 3 or not np.isfinite(linear).all():
        return values
    with np.errstate(all="ignore"):
        given = values.astype(np.float64)
        turned = given @ np.linalg.pinv(linear).T
        lengths, before = (np.linalg.norm(one, axis=1, keepdims=True) for one in (turned, given))
        turned *= np.where(lengths > 0, before / lengths, 1)
    found: Values = turned.astype(values.dtype)
    return found
