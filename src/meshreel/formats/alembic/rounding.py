"""Positions to the float32 of an Alembic mesh, and the transform that makes up for it."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Vertices


class Rounding:
    """Positions beside a point, as float32, and how far that moved them.

    Float32 stays as it is. So does the place of float64, unless the model is so far from the
    origin that float32 would move a vertex by more than a millionth of its size: then the point
    is the middle of the first frame.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Positions of the first frame.

    Attributes
    ----------
    shift : float64 array of shape (3,)
        The point; what is read must be put back by so much.
    largest : float
        How far a coordinate was moved at most, so far.
    """

    def __init__(self, first: Vertices) -> None:
        narrowing = Narrowing()
        narrowing.add(first)
        low, high = first.min(axis=0), first.max(axis=0)
        middle = (low / 2 + high / 2).astype(np.float64)  # halved, for a sum may be infinite
        self.shift = np.zeros(3) if narrowing.is_harmless else middle
        self.largest = 0.0

    def add(self, frame: Vertices) -> npt.NDArray[np.float32]:
        """The next frame, of shape (V, 3).

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
            raise InvalidInputError(
                f"positions in an Alembic file go up to {np.finfo(np.float32).max:.3g}; "
                f"got {np.abs(frame).max():.3g}; scale the model"
            )
        moved = float(np.abs(frame - (rounded + self.shift)).max())
        self.largest = max(self.largest, moved)
        return rounded

    def describe(self) -> str:
        """One sentence on what was moved; empty if nothing was."""
        if self.largest == 0:
            return ""
        beside = ", beside the middle of the first frame" if self.shift.any() else ""
        return (
            f"positions in an Alembic file are float32{beside}: "
            f"coordinates are off by up to {self.largest:.2g}"
        )
