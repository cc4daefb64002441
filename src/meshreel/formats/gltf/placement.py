"""Placement of a mesh with integer positions: a box from -1 to 1 that its node transforms."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.quantized import SHORT
from meshreel.model.sequence import Vertices


@dataclass(frozen=True, eq=False)
class Placement:
    """A translation and a uniform scale, for the node of a mesh.

    Attributes
    ----------
    offset : float64 array of shape (3,)
        Center of the box, exact in float32.
    scale : float
        Half size of the box, positive and exact in float32.
    """

    offset: Floats
    scale: float


IDENTITY = Placement(np.zeros(3), 1.0)
"""The placement that leaves positions unchanged."""


@dataclass(frozen=True, eq=False)
class PlacedFrames:
    """Frames as a base mesh of integers, and displacements from it.

    Attributes
    ----------
    placement : Placement
    base : int16 array of shape (V, 3)
    displacements : float32 array of shape (T, 3 V)
        From the integer base, in units of the placement.
    """

    placement: Placement
    base: npt.NDArray[np.int16]
    displacements: npt.NDArray[np.float32]


def mean_frame(frames: Vertices) -> Floats:
    """Return the mean position of every vertex over all frames, of shape (V, 3)."""
    return np.asarray(frames.mean(axis=0, dtype=np.float64))


def max_displacements(frames: Vertices, base: Floats) -> Floats:
    """Return the largest distance of a vertex from the base, in each frame."""
    return np.array([np.linalg.norm(frame - base, axis=1).max() for frame in frames])


def place_static(base: Vertices) -> tuple[Placement, npt.NDArray[np.float32]]:
    """Return a static mesh in float32, relative to its center unless it is exact in float32."""
    rest = base.astype(np.float32)
    if (rest == base).all():
        return IDENTITY, rest
    offset = _center(base)
    return Placement(offset, 1.0), (base - offset).astype(np.float32)


def place_frames(frames: Vertices, base: Floats) -> PlacedFrames:
    """Return frames of shape (T, V, 3) relative to a base, with all coordinates within -1 to 1."""
    offset = _center(base)
    max_distance = float(max_displacements(frames, base).max())
    reach = max(float(np.abs(base - offset).max()), max_distance)
    smallest = float(np.finfo(np.float32).tiny)
    scale = float(np.nextafter(np.float32(max(reach, smallest)), np.float32(np.inf)))
    integers = np.rint((base - offset) / scale * SHORT).astype(np.int16)
    displacements = np.empty((len(frames), base.size), np.float32)
    rounded = integers / np.float64(SHORT)
    for row, frame in zip(displacements, frames, strict=True):
        row[:] = ((frame - offset) / scale - rounded).ravel()
    return PlacedFrames(Placement(offset, scale), integers, displacements)


def _center(base: Vertices) -> Floats:
    center = (base.min(axis=0) + base.max(axis=0)) / 2
    return np.asarray(center.astype(np.float32), np.float64)


def check_range(low: Floats, high: Floats) -> None:
    """Check that positions fit into float32, the only float type of glTF.

    Raises
    ------
    InvalidInputError
        If a coordinate is too large.
    """
    largest = float(np.maximum(-low, high).max())
    allowed = float(np.finfo(np.float32).max) / 4
    if largest > allowed:
        raise InvalidInputError(
            f"glTF stores float32 positions, up to {allowed:.2g}; got {largest:g}; scale the model"
        )
