"""Decoded blocks, whose frames are computed on demand."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers, Vertices
from meshreel.codec.subspace.trajectories import BoundingFrame, from_matrices
from meshreel.runtime.threads import in_threads

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames computed at a time; they should fit into the cache."""

MAX_FRAMES_TOGETHER = 4

FramesOf = Callable[[slice], Floats]
"""Returns coordinate matrices of shape (3, frames, V) for a slice of the frames of a block."""


@dataclass(frozen=True)
class DecodedBlock:
    """A decoded block, whose frames are products of a basis and coefficients."""

    start: int
    n_frames: int
    """Number of the first frame, and number of frames."""
    frames_of: FramesOf
    """Coordinate matrices of a slice of the frames, in output order of vertices, without exact
    positions.
    """
    frame: BoundingFrame
    exact: Vertices | None = None
    """float array of shape (T_b, N, 3), or None. Positions of some vertices that replace the
    computed ones.
    """
    exact_vertices: Integers | None = None
    """Integer array of shape (N,), or None. These vertices, in output order."""

    def fill(self, out: Vertices, first: int) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block, on all cores.

        Parameters
        ----------
        out : float array of shape (T, V, 3)
        first : int
            Number of the first of these frames within the block.
        """
        last = first + len(out)
        chunk_frames = max(1, min(MAX_FRAMES_TOGETHER, CHUNK_BYTES // (24 * out.shape[1])))

        # Products of matrices round by their shape: the same frames are always computed together.
        def fill(start: int) -> None:
            chunk = slice(start, min(start + chunk_frames, self.n_frames))
            requested = slice(max(start, first), min(chunk.stop, last))
            matrices = self.frames_of(chunk)[:, requested.start - start : requested.stop - start]
            out[requested.start - first : requested.stop - first] = from_matrices(
                matrices, self.frame, out.dtype
            )

        # Damaged values may overflow; the caller checks whether frames are finite.
        with np.errstate(over="ignore", invalid="ignore"):
            in_threads(fill, range(first // chunk_frames * chunk_frames, last, chunk_frames))
        if self.exact is not None:
            out[:, self.exact_vertices] = self.exact[first : first + len(out)]
