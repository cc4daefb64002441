"""The frame of reference that every metric measures in: centred, and scaled to about 1.

Removing the offset keeps the digits of small models far from the origin; scaling by a power of
two rounds nothing and keeps squares of very large or very small coordinates in range.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Vertices

_LARGEST_EXPONENT = 1000  # both 2**1000 and 2**-1000 are normal float64 numbers


@dataclass(frozen=True, eq=False)
class Reference:
    """Centre and power-of-two scale of the bounding box of a whole sequence.

    Attributes
    ----------
    centre : float64 array of shape (3,), in model units
    scale : float
        Model units times this are scaled units, in which the box is about 1 large.
    diagonal_scaled : float
        Diagonal of the box in scaled units; 0 if every vertex of every frame coincides.
    """

    centre: Floats
    scale: float
    diagonal_scaled: float

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, in model units."""
        return self.diagonal_scaled / self.scale

    def apply(self, positions: npt.NDArray[np.floating]) -> Floats:
        """Positions of shape (..., 3) in scaled units, about the centre, in float64."""
        moved = positions - self.centre
        moved *= self.scale
        return moved


def bounding_box_reference(vertices: npt.NDArray[np.floating]) -> Reference:
    """The frame of reference of positions of shape (..., V, 3), in model units."""
    frames = vertices.reshape(-1, *vertices.shape[-2:])  # reducing whole frames first is faster
    low = frames.min(axis=0).min(axis=0).astype(np.float64)
    high = frames.max(axis=0).max(axis=0).astype(np.float64)
    return reference_of_box(low, high)


def reference_of_box(low: Floats, high: Floats) -> Reference:
    """The frame of reference of positions whose bounding box has these corners."""
    low, high = low / 2, high / 2
    half = high - low
    exponent = int(np.frexp(half.max())[1])
    scale = 2.0 ** -int(np.clip(exponent, -_LARGEST_EXPONENT, _LARGEST_EXPONENT))
    return Reference(low + high, scale, 2 * float(np.linalg.norm(half * scale)))


def shared_reference(original: Vertices, decoded: Vertices) -> Reference:
    """The frame of reference of the original, for two sequences that can be compared.

    Raises
    ------
    InvalidInputError
        If the two arrays do not have the same shape (T, V, 3), or T or V is 0.
    """
    require_same_shape(original, decoded)
    if original.size == 0:
        raise InvalidInputError(
            f"a comparison needs at least one frame and one vertex; got shape {original.shape}"
        )
    return bounding_box_reference(original)


def require_same_shape(original: Vertices, decoded: Vertices) -> None:
    """Check that two arrays have the same shape (T, V, 3).

    Raises
    ------
    InvalidInputError
        Naming both shapes.
    """
    if original.ndim != 3 or original.shape != decoded.shape or original.shape[2] != 3:
        raise InvalidInputError(
            "original and decoded must have the same shape (T, V, 3); "
            f"got {original.shape} and {decoded.shape}"
        )


def paired_frames(
    original: Vertices, decoded: Vertices, reference: Reference
) -> Iterator[tuple[Floats, Floats]]:
    """Frame by frame, the original and its displacement in scaled units, each of shape (V, 3).

    Decoded positions are the sum of the two. The displacement is taken before the centre is
    removed: nearby numbers subtract exactly, so errors far below rounding of the positions count.
    """
    for frame, frame_hat in zip(original, decoded, strict=True):
        displacement = np.subtract(frame_hat, frame, dtype=np.float64)
        displacement *= reference.scale
        yield reference.apply(frame), displacement


def relative(error: float, size: float) -> float:
    """``error / size``; 0 where there is no error, infinite where only the size is zero."""
    if error == 0:
        return 0.0
    return error / size if size > 0 else float("inf")
