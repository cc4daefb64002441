"""Weights that follow from the points of items: `docs/format.md`, "Weights from points"."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats


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
