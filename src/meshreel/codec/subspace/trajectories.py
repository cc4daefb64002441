"""Conversion of positions of shape (T, V, 3) to matrices of frames, one per coordinate, and back.

The matrices hold model coordinates relative to the center of the bounding box, divided by its
diagonal, in float64, so that neither a far offset nor a small unit reduces precision.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.extent import Extent

MAX_ORIGIN_ERROR = 1e-3
"""Largest distance of an origin rounded to single precision from the center, in diagonals."""


@dataclass(frozen=True)
class BoundingFrame:
    """Center and diagonal of the bounding box of all frames, of positions or of a track's values.

    Attributes
    ----------
    origin : tuple of C floats
        Center of the box, in model units; C is 3 for positions.
    scale : float
        Diagonal of the box in model units; 1 if the box is a point.
    """

    origin: tuple[float, ...]
    scale: float

    @property
    def placement(self) -> tuple[float, ...]:
        """Scale, and the origin of each column."""
        return self.scale, *self.origin

    @property
    def in_single_precision(self) -> "BoundingFrame":
        """The frame rounded to single precision, or itself if that moves the origin too far.

        The scale is rounded down, so that a bound relative to it is no larger.
        """
        origin, scale = np.array(self.origin), single_below(self.scale)
        with np.errstate(over="ignore", under="ignore"):
            single = origin.astype(np.float32)
        error = np.abs(single - origin).max()
        if error > MAX_ORIGIN_ERROR * self.scale or not _is_normal(scale):
            return self
        return BoundingFrame(tuple(single.tolist()), scale)


def single_below(number: float) -> float:
    """Return the largest single-precision number up to a positive one, if normal; else that one."""
    with np.errstate(over="ignore", under="ignore"):
        single = np.float32(number)
        if number < float(single) < np.inf:
            single = np.nextafter(single, np.float32(0.0))
    return float(single) if _is_normal(float(single)) else number


def _is_normal(number: float) -> bool:
    """Whether a positive number is in the range of normal single-precision numbers."""
    return float(np.finfo(np.float32).tiny) <= number <= float(np.finfo(np.float32).max)


def bounding_frame(extent: Extent) -> BoundingFrame:
    """The bounding frame of positions, or of a track's values, of this extent; always finite."""
    largest_float = float(np.finfo(np.float64).max)
    with np.errstate(over="ignore"):
        sides = extent.high - extent.low
    if not np.isfinite(sides).all():  # overflow
        return BoundingFrame(tuple((extent.low / 2 + extent.high / 2).tolist()), largest_float)
    origin = tuple((extent.low + sides / 2).tolist())
    largest = float(sides.max()) or 1.0  # divided out: squares of tiny sides are 0
    scale = largest * float(np.linalg.norm(sides / largest)) or 1.0
    return BoundingFrame(origin, min(scale, largest_float))


def stored_frame(extent: Extent) -> BoundingFrame:
    """The bounding frame of positions as a stream stores it: in single precision if possible.

    A point keeps its origin, which then is its exact position.
    """
    frame = bounding_frame(extent)
    return frame.in_single_precision if (extent.high > extent.low).any() else frame


def to_matrices(vertices: npt.NDArray[np.floating], frame: BoundingFrame) -> Floats:
    """Coordinate matrices A of shape (3, T, V), relative to the center, in diagonals."""
    # Always a copy, because it is changed in place below.
    matrices = np.array(np.moveaxis(vertices, 2, 0), dtype=np.float64, order="C")
    matrices -= np.array(frame.origin)[:, None, None]
    matrices /= frame.scale
    return matrices


def from_matrices(
    matrices: Floats, frame: BoundingFrame, dtype: npt.DTypeLike
) -> npt.NDArray[np.floating]:
    """Positions of shape (T, V, 3) in model units; inverts `to_matrices` up to rounding."""
    vertices = np.empty((matrices.shape[1], matrices.shape[2], 3), dtype)
    for axis in range(3):
        vertices[:, :, axis] = matrices[axis] * frame.scale + frame.origin[axis]
    return vertices
