"""Decoded blocks: of modes, whose frames are computed on demand, and of positions as they were."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections, corrected, moves_by_frame
from meshreel.codec.frame_products import FramesOf, JointFrames, ProductFrames
from meshreel.kernel.frames import Moves
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads, n_cores
from meshreel.subspace.trajectories import BoundingFrame, from_matrices

Vertices = npt.NDArray[np.floating]
Integers = npt.NDArray[np.int64]

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames that are computed at a time, which should fit into the cache."""

LEAST_FRAMES, MOST_FRAMES = 8, 256
"""Frames that the core computes at a time: for all of them it collects fields once."""


class FrameBlock(Protocol):
    """A decoded block of frames."""

    @property
    def start(self) -> int:
        """Number of the first frame."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""

    @property
    def stop(self) -> int:
        """Number of the frame after the last one."""

    @property
    def modes(self) -> ProductFrames | None:
        """Basis and coefficients whose product the frames are; None for blocks without."""

    @property
    def corrections(self) -> Corrections | None:
        """What moves single vertices, in output order, apart from the modes; None for nothing."""

    def fill(self, out: Vertices, first: int, report: Callable[[int], None] | None = None) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block.

        Parameters
        ----------
        out : float array of shape (T, V, 3)
        first : int
            Number of the first of these frames within the block.
        report : callable, optional
            Called with the number of frames that are done.
        """


@dataclass(frozen=True)
class ExactBlock:
    """A block whose positions are stored as they are.

    Attributes
    ----------
    start : int
        Number of the first frame.
    vertices : float array of shape (T_b, V, 3)
        Positions of all its frames, in output order.
    """

    start: int
    vertices: Vertices

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.vertices)

    @property
    def stop(self) -> int:
        """Number of the frame after the last one."""
        return self.start + self.n_frames

    @property
    def modes(self) -> None:
        """There are none."""
        return None

    @property
    def corrections(self) -> None:
        """There are none."""
        return None

    def fill(self, out: Vertices, first: int, report: Callable[[int], None] | None = None) -> None:
        """Fill an array with frames of this block; as `FrameBlock.fill`."""
        out[:] = self.vertices[first : first + len(out)]
        if report is not None:
            report(len(out))


@dataclass(frozen=True)
class DecodedBlock:
    """A decoded block, whose frames are products of a basis and coefficients.

    Attributes
    ----------
    start, n_frames : int
        Number of the first frame, and number of frames.
    frames_of : FramesOf
        Coordinate matrices of a slice of the frames, in output order of vertices, without
        corrections and exact positions.
    frame : BoundingFrame
    exact : float array of shape (T_b, N, 3), or None
        Positions of some vertices that replace the computed ones.
    exact_places : integer array of shape (N,), or None
        These vertices, in output order.
    corrections : Corrections or None
        Corrections of vertices in output order.
    """

    start: int
    n_frames: int
    frames_of: FramesOf
    frame: BoundingFrame
    exact: Vertices | None = None
    exact_places: Integers | None = None
    corrections: Corrections | None = None

    @property
    def stop(self) -> int:
        """Number of the frame after the last one."""
        return self.start + self.n_frames

    @property
    def modes(self) -> ProductFrames | None:
        """Basis and coefficients whose product the frames are; None for blocks without."""
        if isinstance(self.frames_of, JointFrames):
            return self.frames_of.product
        return self.frames_of if isinstance(self.frames_of, ProductFrames) else None

    @cached_property
    def _final_frames_of(self) -> FramesOf:
        if self.corrections is None:
            return self.frames_of
        return corrected(self.frames_of, self.corrections, None)

    @cached_property
    def _moves(self) -> Moves | None:
        found = self.corrections
        return None if found is None else moves_by_frame(found, self.n_frames)

    @staged("frames")
    def fill(self, out: Vertices, first: int, report: Callable[[int], None] | None = None) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block, on all cores.

        Parameters
        ----------
        out : float array of shape (T, V, 3)
        first : int
            Number of the first of these frames within the block.
        report : callable, optional
            Called with the number of frames that are done.
        """
        product = self.frames_of
        is_direct = isinstance(product, JointFrames) and out.flags.c_contiguous

        def fill(piece: slice) -> None:
            frames = range(first + piece.start, first + piece.stop)
            if isinstance(product, JointFrames) and is_direct:
                moves = None if self._moves is None else self._moves.of_frames(frames)
                product.fill(out[piece], frames, self.frame.placement, moves)
            else:
                matrices = self._final_frames_of(slice(frames.start, frames.stop))
                out[piece] = from_matrices(matrices, self.frame, out.dtype)

        n_together = max(1, CHUNK_BYTES // (24 * out.shape[1]))
        if isinstance(product, JointFrames):
            product.pack()
        if is_direct:
            n_together = max(LEAST_FRAMES, min(-(-len(out) // n_cores()), MOST_FRAMES))
        pieces = chunks(len(out), n_together)
        done = None if report is None else (lambda number: report(pieces[number - 1].stop))
        # Damaged values may overflow; the caller checks whether frames are finite.
        with np.errstate(over="ignore", invalid="ignore"):
            in_threads(fill, pieces, done)
        if self.exact is not None:
            out[:, self.exact_places] = self.exact[first : first + len(out)]
