"""Blocks of the method `reel`: mode fields, predicted over the mesh by adaptive weights.

A mode is a field on the mesh with a basis vector over time for each axis. The core predicts the
fields of a block in closed loop, vertex by vertex over a hierarchy of the mesh. Its initial weights
may follow from the points of items: `docs/format.md`, "Weights from points".
"""

from dataclasses import dataclass
from typing import Any

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


def decode_basis(
    integers: npt.NDArray[np.integer], layout: Layout, key: Floats | None = None
) -> Floats:
    """Decode the temporal basis of a block, of shape (C, T, K), from integers (K, C, T).

    Fields, such as those of the key block, are of shape (V, K), in coding order and in steps of the
    block, which do not depend on its length.

    Vectors have length 1 (or 0), except those of reused modes, whose lengths give the rounding of
    each of their integers the same effect on positions.
    """
    lengths = None
    if key is not None and layout.n_reused:
        lengths = lengths_of(key, layout.n_reused, float(layout.finer))
    return basis_vectors(integers, layout.coding, lengths)


def nugget_of(code: int) -> float:
    """Return the nugget of a code, 0 to 24."""
    return 2.0 ** (8 - code)


@dataclass(frozen=True)
class PointWeights:
    """Initial weights of a block, and the nugget that they were computed with."""

    code: int
    weights: npt.NDArray[np.float32]
    """float32 array of shape (N, S), in coding order."""
    related: int = 0
    """Number of tracks from the related one to this one; 0 without one."""
    fields: Floats | None = None
    """float64 array of shape (N, n), or None. Fields of the related track in this block, in coding
    order.
    """


@dataclass(frozen=True)
class ItemPoints:
    """Vertices whose mean is the point of an item."""

    vertices: npt.NDArray[np.integer[Any]]
    """Integer array of shape (n,). Decoded vertices."""
    items: npt.NDArray[np.integer[Any]] | None = None
    """Integer array of shape (n,). Item that each vertex belongs to; None: item i has vertex i."""

    def of(self, positions: npt.NDArray[np.floating]) -> Floats:
        """Return the points, of shape (N, 3), given decoded positions of shape (V, 3)."""
        points: Floats = positions[self.vertices].astype(np.float64)
        if self.items is None:
            return points
        # `bincount` adds in order, as decoders do.
        sums = np.stack([np.bincount(self.items, column) for column in points.T], axis=1)
        return np.asarray(sums / np.bincount(self.items)[:, None])
