"""Transformation of points, vectors and normals by matrices for row vectors, and rounding."""

from typing import Any

import numpy as np

from meshreel.arrays import Floats, Singles, Values
from meshreel.errors import InvalidInputError
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.notes import Notes
from meshreel.model.sequence import Vertices


def transform_points(points: Vertices, matrix: Floats) -> Vertices:
    """Return points transformed by a matrix, of shape (V, 3).

    They are computed in float64 and rounded once to the type of `points`. The result stays float64
    if it is so far from the origin that rounding would move a vertex by more than a millionth of
    the size of the result.

    Parameters
    ----------
    points : float array of shape (V, 3)
    matrix : float64 array of shape (4, 4)
    """
    if np.array_equal(matrix, np.eye(4)):
        return points
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        world: Vertices = points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]
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
        after_lengths, before_lengths = (
            np.linalg.norm(vectors, axis=1, keepdims=True) for vectors in (after, before)
        )
        scales = np.where(after_lengths > 0, before_lengths / after_lengths, 1)
        normals: Values = (after * scales).astype(values.dtype)
    return normals


def is_mirroring(matrix: Floats) -> bool:
    """Return whether a transform, of shape (4, 4), reverses orientation."""
    with np.errstate(all="ignore"):
        return bool(np.linalg.det(matrix[:3, :3]) < 0)


class Rounding:
    """Rounds positions to float32 relative to a translation, and tracks the largest error.

    The translation is zero, unless float64 positions are so far from the origin that float32
    would move a vertex by more than a millionth of the model size: then it is the center of the
    first frame. Positions that are float32 stay exact.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Positions of the first frame.
    format_name : str
        Name of the format, for messages.

    Attributes
    ----------
    shift : float64 array of shape (3,)
        The translation, which the transform above the mesh must add.
    max_error : float
        Largest rounding error of a coordinate so far.
    """

    def __init__(self, first: Vertices, format_name: str) -> None:
        self._format_name = format_name
        narrowing = Narrowing()
        narrowing.add(first)
        low, high = first.min(axis=0), first.max(axis=0)
        center = (low / 2 + high / 2).astype(np.float64)  # halved first, to avoid overflow
        self.shift: Floats = np.zeros(3) if narrowing.is_harmless else center
        self.max_error: float = 0.0

    def add(self, frame: Vertices) -> Singles:
        """Return the next frame rounded to float32, of shape (V, 3).

        Raises
        ------
        InvalidInputError
            If a position does not fit into float32.
        """
        if frame.dtype == np.float32:
            return frame.astype(np.float32, copy=False)
        with np.errstate(over="ignore"):
            rounded = (frame - self.shift).astype(np.float32)
        if not np.isfinite(rounded).all():
            limit, largest = np.finfo(np.float32).max, np.abs(frame).max()
            raise InvalidInputError(
                f"{self._format_name} stores positions as float32, up to {limit:.3g}; got "
                f"{largest:.3g}; scale the model"
            )
        error = float(np.abs(frame - (rounded + self.shift)).max())
        self.max_error = max(self.max_error, error)
        return rounded

    def note(self, notes: Notes) -> None:
        """Add a note on the rounding error, if there was any."""
        relative = ", relative to the center of the first frame" if self.shift.any() else ""
        if self.max_error:
            notes.changed(
                f"{self._format_name} stores positions as float32{relative}: "
                f"coordinates change by up to {self.max_error:.2g}"
            )
