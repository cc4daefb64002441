"""Positions on a cubic grid, coded by the method `grid`."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Vertices
from meshreel.codec.bitstream.container import write_varints
from meshreel.codec.reel.normative.expected import ranks_of
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.errors import CorruptStreamError
from meshreel.kernel.integers import MAX_MAGNITUDE, encode_integers

Coordinates = npt.NDArray[np.int32]

MAX_COORDINATE = 2**31 - 1

LOSSLESS, EXACT, ON_SURFACE, SINGLE, STILL = 0, 1, 2, 4, 8
"""Forms of positions: without a grid, coordinates as exact values, or as integers on the surface;
and flags of a step in single precision, and of one frame, which all repeat."""


@dataclass(frozen=True)
class PositionGrid:
    """A grid around the center of the bounding box of all frames."""

    step: float
    """Edge of a cube, in diagonals of the box."""
    frame: BoundingFrame

    def coordinates(self, vertices: Vertices) -> Coordinates:
        """Grid coordinates nearest to positions of shape (T, V, 3)."""
        exact = (vertices - np.array(self.frame.origin)) / self.frame.scale / self.step
        clipped: Vertices = np.clip(np.rint(exact), -MAX_COORDINATE, MAX_COORDINATE)
        return clipped.astype(np.int32)

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

    def rounding(self, coordinates: Coordinates, vertices: Vertices) -> bytes | None:
        """Encode how values at the coordinates were rounded, so that positions decode exactly.

        Parameters
        ----------
        coordinates : int32 array of shape (T, V, 3)
        vertices : float array of shape (T, V, 3)

        Returns
        -------
        bytes or None
            The payload of ROUNDING; None if an axis has two values at one coordinate, or more
            coordinates than positions.
        """
        ranks = ranks_of(self.positions(coordinates, vertices.dtype)).astype(np.int64)
        offsets = ranks_of(np.ascontiguousarray(vertices)) - ranks
        if not -MAX_MAGNITUDE <= offsets.min() <= offsets.max() <= MAX_MAGNITUDE:
            return None
        lowest, rows = coordinates.min(axis=(0, 1)), []
        for axis, low in enumerate(lowest):
            cells, values = coordinates[..., axis].astype(np.int64) - low, offsets[..., axis]
            if cells.max() >= cells.size:
                return None
            row = np.zeros(cells.max() + 1, np.int64)
            row[cells] = values
            if not np.array_equal(row[cells], values):
                return None
            rows.append(row)
        return write_varints(*map(len, rows)) + encode_integers([*lowest.reshape(3, 1), *rows])


def write_form(form: int, step: float) -> bytes:
    """Encode a form with a grid, and its step; they precede the coordinates."""
    if float(np.float32(step)) == step:
        return struct.pack("<Bf", form | SINGLE, step)
    return struct.pack("<Bd", form, step)
