"""Positions on a cubic grid, coded by the method `grid`."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import CorruptStreamError

Vertices = npt.NDArray[np.floating]
Coordinates = npt.NDArray[np.int32]

MAX_COORDINATE = 2**31 - 1

NO_GRID = 0.0
"""Stored step of positions that are lossless."""


@dataclass(frozen=True)
class PositionGrid:
    """A grid around the center of the bounding box of all frames.

    Attributes
    ----------
    step : float
        Edge of a cube, in diagonals of the box.
    frame : BoundingFrame
    """

    step: float
    frame: BoundingFrame

    def coordinates(self, vertices: Vertices) -> Coordinates:
        """Grid coordinates nearest to positions of shape (T, V, 3)."""
        exact = (vertices - np.array(self.frame.origin)) / self.frame.scale / self.step
        within: Vertices = np.clip(np.rint(exact), -MAX_COORDINATE, MAX_COORDINATE)
        return within.astype(np.int32)

    def positions(self, coordinates: Coordinates, dtype: npt.DTypeLike) -> Vertices:
        """Positions at grid coordinates, in model units.

        Raises
        ------
        CorruptStreamError
            If a position is not finite.
        """
        positions = coordinates * self.step * self.frame.scale + np.array(self.frame.origin)
        with np.errstate(over="ignore"):
            rounded: Vertices = positions.astype(dtype)
        if not np.isfinite(rounded).all():
            raise CorruptStreamError(
                f"positions on a grid of {self.step:g} diagonals go beyond the numbers of type "
                f"{rounded.dtype}"
            )
        return rounded


def write_step(step: float) -> bytes:
    """Encode the step of a grid, or `NO_GRID`; it precedes the coordinates."""
    return struct.pack("<d", step)
