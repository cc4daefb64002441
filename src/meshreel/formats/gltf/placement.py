"""Where a mesh of integer positions stands: the box of -1..1 that its node moves and scales."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.quantized import SHORT
from meshreel.model.sequence import Vertices


@dataclass(frozen=True, eq=False)
class Placement:
    """A box in which lengths are one scale from its middle to its sides.

    Attributes
    ----------
    offset : float64 array of shape (3,)
        Its middle. A float32 is the same.
    scale : float
        Positive. A float32 is the same.
    """

    offset: Floats
    scale: float


NOWHERE = Placement(np.zeros(3), 1.0)
"""The placement that changes nothing."""


@dataclass(frozen=True, eq=False)
class PlacedFrames:
    """Frames as a base mesh of integers, and displacements from it.

    Attributes
    ----------
    base : int16 array of shape (V, 3)
    moves : float32 array of shape (T, 3 V)
        From the base as integers say it, in the lengths of the placement.
    """

    placement: Placement
    base: npt.NDArray[np.int16]
    moves: npt.NDArray[np.float32]


def mean_frame(frames: Vertices) -> Floats:
    """The mean of every vertex over all frames, of shape (V, 3)."""
    return np.asarray(frames.mean(axis=0, dtype=np.float64))


def ways(frames: Vertices, base: Floats) -> Floats:
    """How far a vertex is from the base at most, in each frame."""
    return np.array([np.linalg.norm(frame - base, axis=1).max() for frame in frames])


def place_still(base: Vertices) -> tuple[Placement, npt.NDArray[np.float32]]:
    """A mesh that does not move, in float32: around its middle if that is not the same there."""
    rest = base.astype(np.float32)
    if (rest == base).all():
        return NOWHERE, rest
    offset = _middle(base)
    return Placement(offset, 1.0), (base - offset).astype(np.float32)


def place_frames(frames: Vertices, base: Floats) -> PlacedFrames:
    """Frames of shape (T, V, 3) around a base, so that no coordinate of either exceeds 1."""
    offset = _middle(base)
    reach = max(float(np.abs(base - offset).max()), float(ways(frames, base).max()))
    smallest = float(np.finfo(np.float32).tiny)
    scale = float(np.nextafter(np.float32(max(reach, smallest)), np.float32(np.inf)))
    integers = np.rint((base - offset) / scale * SHORT).astype(np.int16)
    moves = np.empty((len(frames), base.size), np.float32)
    rounded = integers / np.float64(SHORT)
    for row, frame in zip(moves, frames, strict=True):
        row[:] = ((frame - offset) / scale - rounded).ravel()
    return PlacedFrames(Placement(offset, scale), integers, moves)


def _middle(base: Vertices) -> Floats:
    middle = (base.min(axis=0) + base.max(axis=0)) / 2
    return np.asarray(middle.astype(np.float32), np.float64)


def check_range(low: Floats, high: Floats) -> None:
    """Refuse positions that are no float32, which is all that glTF files hold.

    Raises
    ------
    InvalidInputError
        Naming the largest.
    """
    largest = float(np.maximum(-low, high).max())
    allowed = float(np.finfo(np.float32).max) / 4
    if largest > allowed:
        raise InvalidInputError(
            f"a glTF file holds float32, here up to {allowed:.2g}; got {largest:g}; scale down"
        )
