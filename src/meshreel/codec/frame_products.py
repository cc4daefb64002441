"""Frames of a block as the product of a basis and coefficients."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.subspace.basis import expand

Floats = npt.NDArray[np.float64]

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
        if len(self.coefficients) > 1:
            return expand(self.basis[:, frames], self.coefficients)
        # One product for all axes: it reads the fields once.
        n_modes, n_verts = self.coefficients.shape[1:]
        rows = self.basis[:, frames].reshape(-1, n_modes)
        return expand(rows, self.coefficients[0]).reshape(3, -1, n_verts)


def product_frames(basis: Floats, coefficients: Floats) -> ProductFrames:
    """The product of a basis and coefficients, which are made contiguous."""
    return ProductFrames(basis, np.ascontiguousarray(coefficients))
