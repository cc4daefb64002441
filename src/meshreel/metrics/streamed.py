"""Errors of frames decoded block by block, against an original that need not fit in memory."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.metrics.displacement import DisplacementSums
from meshreel.metrics.frame_sums import sums_of_frames
from meshreel.metrics.kg import KgSums
from meshreel.metrics.reference import reference_of_box, require_same_shape
from meshreel.model.extent import Extent
from meshreel.model.sequence import FrameSource, Vertices

BYTES_PER_READ = 1 << 23
"""Size of the frames of the original that are read at a time."""


@dataclass(frozen=True)
class StreamedErrors:
    """Errors that can be accumulated over blocks of frames; 0 if decoded and original are equal.

    Attributes
    ----------
    max_error_percent, rms_error_percent : float
        Vertex displacement in percent of the diagonal of the whole original sequence.
    """

    kg_error_percent: float
    max_error_percent: float
    rms_error_percent: float


class ErrorSums:
    """Accumulator of KG error and vertex displacements over blocks of frames.

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
        """Add frames of both sequences, of shape (T, V, 3), V at least 1.

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
        """The errors of all frames so far, equal to those of the functions for whole sequences.

        Raises
        ------
        InvalidInputError
            If no frame was added.
        """
        if self._n_frames == 0:
            raise InvalidInputError("a comparison needs at least one frame; got none")
        displacements = self._displacements.errors
        return StreamedErrors(
            self._kg.percent, displacements.max_percent, displacements.rms_percent
        )


def add_sequence(sums: ErrorSums, original: FrameSource, decoded: FrameSource) -> None:
    """Add all frames of two sequences of the same mesh; a part of both is in memory at a time."""
    n_per_read = max(1, BYTES_PER_READ // max(1, decoded.n_verts * 3 * decoded.dtype.itemsize))
    n_frames = decoded.n_frames
    blocks = (
        (start, decoded.read(start, min(start + n_per_read, n_frames)))
        for start in range(0, n_frames, n_per_read)
    )
    add_blocks(sums, original, blocks)


def streamed_errors(
    original: FrameSource, decoded_blocks: Iterable[tuple[int, Vertices]]
) -> StreamedErrors:
    """KG error, largest and RMS displacement of a sequence decoded block by block.

    They equal `kg_error_percent` and `displacement_errors_percent` of whole sequences. Parameters
    and errors raised are those of `add_blocks`.
    """
    sums = ErrorSums(original.extent)
    add_blocks(sums, original, decoded_blocks)
    return sums.errors


def add_blocks(
    sums: ErrorSums, original: FrameSource, decoded_blocks: Iterable[tuple[int, Vertices]]
) -> None:
    """Add all frames of a sequence decoded block by block.

    Memory contains one decoded block and `BYTES_PER_READ` of the original.

    Parameters
    ----------
    original : FrameSource
    decoded_blocks : iterable of (int, float array of shape (T, V, 3))
        Number of the first frame of a block, and its positions in the vertex order of the
        original. Blocks may come in any order, but every frame exactly once.

    Raises
    ------
    InvalidInputError
        If a block has the wrong shape, or a frame is out of range, repeated or missing.
    """
    n_frames = original.n_frames
    is_decoded = np.zeros(n_frames, bool)
    for start, decoded in decoded_blocks:
        stop = start + len(decoded)
        if not (start >= 0 and stop <= n_frames):
            raise InvalidInputError(
                f"frames {start} to {stop - 1} were decoded; "
                f"the original has frames 0 to {n_frames - 1}"
            )
        if is_decoded[start:stop].any():
            raise InvalidInputError(f"a frame from {start} to {stop - 1} was decoded twice")
        is_decoded[start:stop] = True
        n_per_read = max(1, BYTES_PER_READ // max(1, decoded[:1].nbytes))
        for first in range(start, stop, n_per_read):
            end = min(first + n_per_read, stop)
            sums.add(original.read(first, end), decoded[first - start : end - start])
    if not is_decoded.all():
        missing = int(np.argmin(is_decoded))
        raise InvalidInputError(f"frame {missing} of the original was not decoded")
