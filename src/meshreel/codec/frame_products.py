"""Frames of a block as the product of a basis and coefficients."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.subspace.basis import expand
from meshreel.kernel.frames import (
    Moves,
    PackedFields,
    fill_values,
    frame_columns,
    packed_fields,
)

Integers = npt.NDArray[np.integer]

FramesOf = Callable[[slice], Floats]
"""Returns coordinate matrices of shape (3, frames, V) of a range of frames of a block."""


@dataclass(frozen=True)
class ProductFrames:
    """Frames as the product of a basis and coefficients, a `FramesOf`.

    Attributes
    ----------
    basis : float64 array of shape (3, T, K)
    coefficients : float64 array of shape (3, K, V), or (1, K, V) for all axes
    """

    basis: Floats
    coefficients: Floats

    def __call__(self, frames: slice) -> Floats:
        """Coordinate matrices of shape (3, frames, V) of a range of frames."""
        if len(self.coefficients) == 1:
            numbers = range(*frames.indices(self.basis.shape[1]))
            return frame_columns(self.basis, self._packed, numbers)
        return expand(self.basis[:, frames], self.coefficients)

    @cached_property
    def _packed(self) -> PackedFields:
        return packed_fields(self.coefficients[0])


@dataclass(frozen=True)
class JointFrames:
    """Frames as the product of a basis and fields that all columns share, a `FramesOf`.

    The core computes it, and every machine finds the same bits.

    Attributes
    ----------
    basis : float64 array of shape (C, T, K)
        C columns; positions have x, y and z.
    values : float64 array of shape (V, K)
        Fields in steps.
    order : integer array of shape (V,)
        The row of `values` that each vertex of the frames has.
    is_single : bool, default False
        Products are summed up in IEEE single precision, and not in double.
    """

    basis: Floats
    values: Floats
    step: float
    order: Integers
    is_single: bool = False

    def __call__(self, frames: slice) -> Floats:
        """Coordinate matrices of shape (3, frames, V) of a range of frames."""
        numbers = range(*frames.indices(self.basis.shape[1]))
        return frame_columns(self.basis, self.packed, numbers)

    @cached_property
    def packed(self) -> PackedFields:
        """The fields as frames are multiplied of them, packed once for all calls."""
        return packed_fields(
            self.values.T, step=self.step, is_single=self.is_single, order=self.order
        )

    def pack(self) -> None:
        """Pack the fields now, on all cores: threads that fill frames would each do it."""
        _ = self.packed

    def fill(
        self,
        out: npt.NDArray[np.floating],
        frames: range,
        placement: Sequence[float],
        moves: Moves | None = None,
    ) -> None:
        """Fill a contiguous array of shape (n, V, C) with values of n frames, in model units.

        The placement is the scale, and the origin of each column. Positions are those that
        `from_matrices` makes of ``self(frames)``, to the last bit.
        """
        fill_values(out, self.basis, self.packed, frames, placement, moves)


def product_frames(basis: Floats, coefficients: Floats) -> ProductFrames:
    """The product of a basis and coefficients, which are made contiguous."""
    return ProductFrames(basis, np.ascontiguousarray(coefficients))
