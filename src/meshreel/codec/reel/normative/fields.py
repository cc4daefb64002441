"""Blocks of the method `reel`: mode fields, predicted over the mesh by adaptive weights.

A mode is a field on the mesh with a basis vector over time for each axis. The core predicts the
fields of a block in closed loop, vertex by vertex over a hierarchy of the mesh.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.basis import BY_TIMES, BasisCoding, basis_vectors, lengths_of

NONE_REUSED = np.float32(0.0)


@dataclass(frozen=True)
class Layout:
    """Parameters of a block that the decoder needs."""

    step: np.float32
    """Quantization step of the fields."""
    stencil_size: int
    """Number of vertices that predict one."""
    n_learned: int
    """Number of modes, starting with the first, that the prediction weights adapt to."""
    reference: int = 0
    """Number of blocks from the key block to this one; the weights adapt to its fields first. 0:
    none, so this block can be a key block.
    """
    is_single: bool = False
    """Whether frames are summed over the modes in single precision, rather than double."""
    n_reused: int = 0
    """Number of modes, starting with the first, whose fields are those of the key block."""
    finer: np.float32 = NONE_REUSED
    """Step of the vectors of reused modes divided by that of a position; 0 without these
    modes.
    """
    coding: BasisCoding = BY_TIMES
    """Coding of the temporal basis."""
    nugget: int | None = None
    """Code of the nugget if the initial weights follow from points, else None."""
    related: int = 0
    """Number of tracks from the related one to this one; 0 without one."""


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers."""

    layout: Layout
    basis: npt.NDArray[np.int32]
    """int32 array of shape (K, C, T). Residuals of the temporal basis, or coefficients of cosines;
    C columns, such as x, y and z.
    """
    fields: npt.NDArray[np.int32]
    """int32 array of shape (K - n_reused, V). Residuals of the fields that are not reused, in
    coding order.
    """

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.basis.shape[0])


def with_reused(new_fields: Floats, n_reused: int, key: Floats | None) -> Floats:
    """Return all fields of a block: the reused ones of the key block, then the new ones.

    Fields, here and in `decode_basis`, are of shape (V, K), in coding order and in steps of the
    block, which do not depend on its length.
    """
    if key is None or not n_reused:
        return new_fields
    return np.concatenate([key[:, :n_reused], new_fields], axis=1)


def decode_basis(
    integers: npt.NDArray[np.integer], layout: Layout, key: Floats | None = None
) -> Floats:
    """Decode the temporal basis of a block, of shape (C, T, K), from integers (K, C, T).

    Vectors have length 1 (or 0), except those of reused modes, whose lengths give the rounding of
    each of their integers the same effect on positions.
    """
    lengths = None
    if key is not None and layout.n_reused:
        lengths = lengths_of(key, layout.n_reused, float(layout.finer))
    return basis_vectors(integers, layout.coding, lengths)
