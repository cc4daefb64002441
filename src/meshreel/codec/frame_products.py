"""Frames of a block as the product of a basis and coefficients."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.kernel.frames import Moves, fill_positions, frame_axes
from meshreel.subspace.basis import expand
from meshreel.subspace.trajectories import BoundingFrame

Floats = npt.NDArray[np.float64]

FramesOf = Callable[[slice], Floats]
"""Returns coordinate matrices of shape (3, frames, V) of a range of frames of a block."""


@dataclass(frozen=True)
class ProductFrames:
    """Frames as the product of a basis and coefficients, a `FramesOf`.

    Where all axes have the same coefficients the core computes it, and every machine finds the
    same bits.

    Attributes
    ----------
    basis : float64 array of shape (3, T, K)
    coefficients : float64 array of shape (3, K, V), or (1, K, V) for all axes
    """

    basis: Floats
    coefficients: Floats

    def __call__(self, frames: slice) -> Floats:
        """Coordinate matrices of shape (3, frames, V) of a range of frames."""
        if self.is_joint:
            numbers = range(*frames.indices(self.basis.shape[1]))
            return frame_axes(self.basis, self.coefficients[0], numbers)
        return expand(self.basis[:, frames], self.coefficients)

    @property
    def is_joint(self) -> bool:
        """Whether all axes have the same coefficients."""
        return len(self.coefficients) == 1

    def fill(
        self,
        out: npt.NDArray[np.floating],
        frames: range,
        frame: BoundingFrame,
        moves: Moves | None = None,
    ) -> None:
        """Fill a contiguous array of shape (n, V, 3) with positions of n frames, in model units.

        The product has to be joint. The positions are those that `from_matrices` makes of
        ``self(frames)``, to the last bit.
        """
        placement = (frame.scale, *frame.origin)
        fill_positions(out, self.basis, self.coefficients[0], frames, placement, moves)


def product_frames(basis: Floats, coefficients: Floats) -> ProductFrames:
    """The product of a basis and coefficients, which are made contiguous."""
    return ProductFrames(basis, np.ascontiguousarray(coefficients))
