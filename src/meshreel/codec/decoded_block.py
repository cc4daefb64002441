"""A decoded block: frames that are one product away."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections, corrected
from meshreel.codec.frame_products import FramesOf, ProductFrames
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads
from meshreel.subspace.trajectories import BoundingFrame, from_matrices

Vertices = npt.NDArray[np.floating]
Integers = npt.NDArray[np.int64]

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames that are expanded at a time: they should stay in the cache."""


@dataclass(frozen=True)
class DecodedBlock:
    """A block whose frames are one product away.

    Attributes
    ----------
    start, n_frames : int
        Where its frames belong.
    frames_of : FramesOf
        Coordinate matrices of a slice of its frames, in the order in which vertices go out; what
        is corrected or exact is not so yet.
    frame : BoundingFrame
    exact : float array of shape (T_b, N, 3), or None
        Positions of some vertices, in place of those that are computed.
    exact_places : integer array of shape (N,), or None
        Which vertices these are, as they go out.
    corrections : Corrections or None
        Of vertices as they go out.
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
        """Frame behind its last one."""
        return self.start + self.n_frames

    @property
    def modes(self) -> ProductFrames | None:
        """The basis and the coefficients that frames are the product of; some blocks have none."""
        return self.frames_of if isinstance(self.frames_of, ProductFrames) else None

    @cached_property
    def _final_frames_of(self) -> FramesOf:
        if self.corrections is None:
            return self.frames_of
        return corrected(self.frames_of, self.corrections, None)

    @staged("frames")
    def fill(
        self, target: Vertices, first: int, report: Callable[[int], None] | None = None
    ) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block, on all cores.

        Parameters
        ----------
        target : float array of shape (T, V, 3)
        first : int
            Number of the first of them within the block.
        report : callable, optional
            Told how many frames are done.
        """

        def fill(piece: slice) -> None:
            matrices = self._final_frames_of(slice(first + piece.start, first + piece.stop))
            target[piece] = from_matrices(matrices, self.frame, target.dtype)

        pieces = chunks(len(target), max(1, CHUNK_BYTES // (24 * target.shape[1])))
        done = None if report is None else (lambda number: report(pieces[number - 1].stop))
        # Damaged values may overflow; whoever takes the frames looks for what is not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            in_threads(fill, pieces, done)
        if self.exact is not None:
            target[:, self.exact_places] = self.exact[first : first + len(target)]
