"""Positions of shape (T, V, 3) as one matrix of frames for each coordinate, and back.

The matrices hold model coordinates moved to the origin and divided by the size, in float64, so
that neither a far offset nor a small unit costs precision.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BoundingFrame:
    """Where the model lies and how large it is: the bounding box of all frames.

    Attributes
    ----------
    origin : tuple of 3 floats
        Centre of the box, in model units.
    scale : float
        Diagonal of the box in model units; 1 where the box is a point.
    """

    origin: tuple[float, float, float]
    scale: float


def bounding_frame(vertices: npt.NDArray[np.floating]) -> BoundingFrame:
    """The frame of positions of shape (T, V, 3)."""
    # Whole frames first: reducing both axes at once is several times slower.
    low = vertices.min(axis=0).min(axis=0).astype(np.float64)
    high = vertices.max(axis=0).max(axis=0).astype(np.float64)
    x, y, z = (low + (high - low) / 2).tolist()
    extent = high - low
    largest = float(extent.max()) or 1.0  # taken out, for squares of tiny extents are 0
    return BoundingFrame((x, y, z), largest * float(np.linalg.norm(extent / largest)) or 1.0)


def to_matrices(vertices: npt.NDArray[np.floating], frame: BoundingFrame) -> Floats:
    """Coordinate matrices A of shape (3, T, V), in diagonals from the centre."""
    # A copy even where nothing needs converting: it is changed in place below.
    matrices = np.array(np.moveaxis(vertices, 2, 0), dtype=np.float64, order="C")
    matrices -= np.array(frame.origin)[:, None, None]
    matrices /= frame.scale
    return matrices


def from_matrices(
    matrices: Floats, frame: BoundingFrame, dtype: npt.DTypeLike
) -> npt.NDArray[np.floating]:
    """Positions of shape (T, V, 3) in model units; undoes `to_matrices` up to rounding."""
    vertices = np.empty((matrices.shape[1], matrices.shape[2], 3), dtype)
    for axis in range(3):
        vertices[:, :, axis] = matrices[axis] * frame.scale + frame.origin[axis]
    return vertices
