"""Normalization of coordinates for metrics: centered, and scaled to about 1.

Removing the offset keeps the digits of small models far from the origin; scaling by a power of
two is exact and keeps squares of very large or very small coordinates in range.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent, Vertices
from meshreel.runtime.counting import counted

_LARGEST_EXPONENT = 1000  # both 2**1000 and 2**-1000 are normal float64 numbers


@dataclass(frozen=True, eq=False)
class Reference:
    """Center and power-of-two scale of the bounding box of a whole sequence."""

    center: Floats
    """float64 array of shape (3,), in model units."""
    scale: float
    """Factor from model units to scaled units, in which the size of the box is about 1."""
    diagonal_scaled: float
    """Diagonal of the box in scaled units; 0 if all vertices of all frames coincide."""

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, in model units."""
        return self.diagonal_scaled / self.scale

    def apply(self, positions: npt.NDArray[np.floating]) -> Floats:
        """Centered positions of shape (..., 3) in scaled units, in float64."""
        scaled = positions - self.center
        scaled *= self.scale
        return scaled


def bounding_box_reference(vertices: npt.NDArray[np.floating]) -> Reference:
    """Reference of positions of shape (..., V, 3), in model units."""
    frames = vertices.reshape(-1, *vertices.shape[-2:])  # reducing whole frames first is faster
    low = frames.min(axis=0).min(axis=0).astype(np.float64)
    high = frames.max(axis=0).max(axis=0).astype(np.float64)
    return reference_of_box(low, high)


def reference_of_box(low: Floats, high: Floats) -> Reference:
    """Reference of positions whose bounding box has these corners."""
    low, high = low / 2, high / 2
    half = high - low
    exponent = int(np.frexp(half.max())[1])
    scale = 2.0 ** -int(np.clip(exponent, -_LARGEST_EXPONENT, _LARGEST_EXPONENT))
    return Reference(low + high, scale, 2 * float(np.linalg.norm(half * scale)))


def reference_of_extent(extent: Extent) -> Reference:
    """Reference of positions of this extent."""
    return reference_of_box(extent.low, extent.high)


class _Frames(Protocol):
    @property
    def n_frames(self) -> int: ...


def require_equal_frame_counts(original: _Frames, decoded: _Frames, remark: str) -> None:
    """Raise InvalidInputError, with a remark, if frame counts differ."""
    if original.n_frames != decoded.n_frames:
        raise InvalidInputError(
            f"the original has {counted(original.n_frames, 'frame')} and the decoded "
            f"{decoded.n_frames}; {remark}"
        )


def shared_reference(original: Vertices, decoded: Vertices) -> Reference:
    """Reference of the original, after a check that both sequences are comparable.

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
        If they differ; the message has both shapes.
    """
    if original.ndim != 3 or original.shape != decoded.shape or original.shape[2] != 3:
        raise InvalidInputError(
            "original and decoded must have the same shape (T, V, 3); "
            f"got {original.shape} and {decoded.shape}"
        )


def paired_frames(
    original: Vertices, decoded: Vertices, reference: Reference
) -> Iterator[tuple[Floats, Floats]]:
    """Yield original positions and displacements of each frame, in scaled units, of shape (V, 3).

    Decoded positions are the sum of the two. Displacements are computed before centering: nearby
    numbers subtract exactly, which keeps errors far below the rounding of positions.
    """
    for frame, frame_hat in zip(original, decoded, strict=True):
        displacement = np.subtract(frame_hat, frame, dtype=np.float64)
        displacement *= reference.scale
        yield reference.apply(frame), displacement


def relative(error: float, size: float) -> float:
    """``error / size``; 0 without error, infinite if only the size is zero."""
    if error == 0:
        return 0.0
    return error / size if size > 0 else float("inf")
