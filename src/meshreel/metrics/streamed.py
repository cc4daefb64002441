"""Errors of frames that are decoded block by block, against an original that may stay in files."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.metrics.displacement import DisplacementSums
from meshreel.metrics.frame_sums import sums_of_frames
from meshreel.metrics.kg import KgSums
from meshreel.metrics.reference import reference_of_box, require_same_shape
from meshreel.model.sequence import Extent, FrameSource, Vertices

BYTES_AT_ONCE = 1 << 23
"""Size of the frames of the original that are read at a time."""


@dataclass(frozen=True)
class StreamedErrors:
    """Errors that can be told from blocks of frames; 0 if decoded and original are equal.

    Attributes
    ----------
    max_error_percent, rms_error_percent : float
        Vertex displacement in percent of the diagonal of the whole original sequence.
    """

    kg_error_percent: float
    max_error_percent: float
    rms_error_percent: float


class ErrorSums:
    """KG error and vertex displacements of a sequence, gathered block by block.

    Parameters
    ----------
    extent : Extent
        Of the whole original sequence.
    """

    def __init__(self, extent: Extent) -> None:
        self._reference = reference_of_box(extent.low, extent.high)
        self._kg = KgSums()
        self._displacements = DisplacementSums(self._reference.diagonal_scaled)
        self._n_frames = 0

    def add(self, original: Vertices, decoded: Vertices) -> None:
        """Take in the next frames of both sequences, of shape (T, V, 3), V at least 1.

        Raises
        ------
        InvalidInputError
            If the shapes differ.
        """
        require_same_shape(original, decoded)
        frames = sums_of_frames(original, decoded, self._reference)
        self._kg.add(frames)
        self._displacements.add(frames)
        self._n_frames += len(original)

    @property
    def errors(self) -> StreamedErrors:
        """The errors of all frames so far: what the functions for whole sequences give.

        Raises
        ------
        InvalidInputError
            If there was no frame.
        """
        if self._n_frames == 0:
            raise InvalidInputError("a comparison needs at least one frame; got none")
        displacements = self._displacements.errors
        return StreamedErrors(
            self._kg.percent, displacements.max_percent, displacements.rms_percent
        )


def streamed_errors(
    original: FrameSource, decoded_blocks: Iterable[tuple[int, Vertices]]
) -> StreamedErrors:
    """KG error, largest and RMS displacement of a sequence that is decoded block by block.

    They are what `kg_error_percent` and `displacement_errors_percent` give of whole sequences.
    Memory holds one decoded block and some frames.

    Parameters
    ----------
    original : FrameSource
        Some frames of which are read at a time.
    decoded_blocks : iterable of (int, float array of shape (T, V, 3))
        The number of the first frame of a block, and its positions in the vertex order of the
        original. Blocks may come in any order, but every frame must come once.

    Raises
    ------
    InvalidInputError
        If a block has another shape, or a frame is not there, comes twice, or does not come.
    """
    sums, n_frames = ErrorSums(original.extent), original.n_frames
    has_come = np.zeros(n_frames, bool)
    for start, decoded in decoded_blocks:
        stop = start + len(decoded)
        if not (start >= 0 and stop <= n_frames):
            raise InvalidInputError(
                f"frames {start} to {stop - 1} were decoded; "
                f"the original has frames 0 to {n_frames - 1}"
            )
        if has_come[start:stop].any():
            raise InvalidInputError(f"a frame of {start} to {stop - 1} was decoded before")
        has_come[start:stop] = True
        n_together = max(1, BYTES_AT_ONCE // max(1, decoded[:1].nbytes))
        for first in range(start, stop, n_together):
            end = min(first + n_together, stop)
            sums.add(original.read(first, end), decoded[first - start : end - start])
    if not has_come.all():
        raise InvalidInputError(f"frame {int(np.argmin(has_come))} of the original was not decoded")
    return sums.errors
