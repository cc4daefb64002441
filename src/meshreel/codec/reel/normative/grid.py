"""Positions on a grid of cubes: what integers of the method `grid` stand for."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import CorruptStreamError

Vertices = npt.NDArray[np.floating]
Numbers = npt.NDArray[np.int32]

MOST_NUMBER = 2**31 - 1

NO_GRID = 0.0
"""The step of positions that are stored as they are."""


@dataclass(frozen=True)
class PositionGrid:
    """A grid around the centre of the bounding box of all frames.

    Attributes
    ----------
    step : float
        Edge of a cube, in diagonals of the box.
    frame : BoundingFrame
    """

    step: float
    frame: BoundingFrame

    def numbers(self, vertices: Vertices) -> Numbers:
        """The nearest places of the grid, of the shape of positions of shape (T, V, 3)."""
        places = (vertices - np.array(self.frame.origin)) / self.frame.scale / self.step
        within: Vertices = np.clip(np.rint(places), -MOST_NUMBER, MOST_NUMBER)
        return within.astype(np.int32)

    def positions(self, numbers: Numbers, dtype: npt.DTypeLike) -> Vertices:
        """Positions at places of the grid, in model units.

        Raises
        ------
        CorruptStreamError
            If one is not finite.
        """
        found = numbers * self.step * self.frame.scale + np.array(self.frame.origin)
        with np.errstate(over="ignore"):
            rounded: Vertices = found.astype(dtype)
        if not np.isfinite(rounded).all():
            raise CorruptStreamError(
                f"positions on a grid of {self.step:g} diagonals go beyond the numbers of type "
                f"{rounded.dtype}"
            )
        return rounded


def write_step(step: float) -> bytes:
    """The step of a grid, or `NO_GRID`, before the numbers."""
    return struct.pack("<d", step)
