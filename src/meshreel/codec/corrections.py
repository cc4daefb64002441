"""Corrections of single positions, which guarantee an error bound.

Positions of a decoded block that violate the bound are displaced by multiples of a step. They
cluster in vertices and runs of frames, and are coded accordingly.
"""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.kernel.frames import FrameCorrections


@dataclass(frozen=True)
class Corrections:
    """Displacements of positions of a block, as multiples of a step."""

    step: np.float32
    """Quantization step of the displacements, in diagonals."""
    vertices: Integers
    frames: Integers
    """int64 arrays of shape (N,). Internal vertex numbers and frames of the block, ordered by
    vertex, then frame.
    """
    offsets: Integers
    """int64 array of shape (N, 3)."""

    @property
    def displacements(self) -> Floats:
        """Displacements of shape (N, 3), in diagonals."""
        return np.asarray(self.offsets * float(self.step))

    def by_frame(self, n_frames: int) -> FrameCorrections:
        """Group the displacements by frame, with ascending vertices."""
        order = np.lexsort((self.vertices, self.frames))
        starts = np.searchsorted(self.frames[order], np.arange(n_frames + 1))
        vertices = self.vertices[order].astype(np.int32)
        displacements = np.ascontiguousarray(self.displacements[order])
        return FrameCorrections(starts.astype(np.int64), vertices, displacements)
