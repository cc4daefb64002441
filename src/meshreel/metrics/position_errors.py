"""KG error and vertex displacements, of whole sequences or accumulated over blocks of frames."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from meshreel.errors import InvalidInputError
from meshreel.metrics.frame_sums import sums_of_frames
from meshreel.metrics.reference import Reference, relative, require_same_shape, shared_reference
from meshreel.model.sequence import FrameSource, Vertices

BYTES_PER_READ = 1 << 23
"""Size of the original frames read at a time."""


@dataclass(frozen=True)
class PositionErrors:
    """Errors of decoded positions; 0 if decoded and original are equal.

    Attributes
    ----------
    kg_error_percent : float
        ``100 ||G - G^||_F / ||G - E(G)||_F`` over all frames, where E(G) replaces every vertex by
        the mean vertex of its frame. Moving or scaling both sequences alike does not change it. If
        all vertices coincide within each original frame, every error above 0 is infinite.
    max_error_percent, rms_error_percent : float
        Largest and root mean squared displacement of the vertices, in percent of the diagonal of
        the bounding box of all frames of the original. Without a diagonal, every error above 0 is
        infinite.

    Source: Karni and Gotsman, "Spectral compression of mesh geometry", SIGGRAPH 2000, and the KG
    error of sequences in their "Compression of soft-body animation sequences", 2004.
    """

    kg_error_percent: float
    max_error_percent: float
    rms_error_percent: float


class ErrorSums:
    """Accumulator of the errors of positions over frames.

    Parameters
    ----------
    reference : Reference
        Of the whole original sequence.
    """

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self._error = self._largest = self._spread = 0.0
        self._n_positions = 0

    def add(self, original: Vertices, decoded: Vertices) -> None:
        """Add frames of both sequences, of shape (T, V, 3), V at least 1.

        Raises
        ------
        InvalidInputError
            If the shapes differ.
        """
        require_same_shape(original, decoded)
        for frame in sums_of_frames(original, decoded, self._reference):
            self._error += frame.error
            self._largest = max(self._largest, frame.largest)
            self._spread += frame.spread
            self._n_positions += frame.n_verts

    @property
    def errors(self) -> PositionErrors:
        """The errors of all frames so far.

        Raises
        ------
        InvalidInputError
            If no frame was added.
        """
        if self._n_positions == 0:
            raise InvalidInputError("a comparison needs at least one frame; got none")
        diagonal, mean = self._reference.diagonal_scaled, self._error / self._n_positions
        return PositionErrors(
            100 * relative(math.sqrt(self._error), math.sqrt(self._spread)),
            100 * relative(math.sqrt(self._largest), diagonal),
            100 * relative(math.sqrt(mean), diagonal),
        )


def position_errors(original: Vertices, decoded: Vertices) -> PositionErrors:
    """Errors of decoded positions of all frames.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    sums = ErrorSums(shared_reference(original, decoded))
    sums.add(original, decoded)
    return sums.errors


def add_sequence(sums: ErrorSums, original: FrameSource, decoded: FrameSource) -> None:
    """Add all frames of two sequences of the same mesh, reading a part of both at a time."""
    n_per_read = max(1, BYTES_PER_READ // max(1, decoded.n_verts * 3 * decoded.dtype.itemsize))
    n_frames = decoded.n_frames
    starts = range(0, n_frames, n_per_read)
    blocks = (decoded.read(start, min(start + n_per_read, n_frames)) for start in starts)
    add_blocks(sums, original, blocks)


def add_blocks(sums: ErrorSums, original: FrameSource, decoded_blocks: Iterable[Vertices]) -> None:
    """Add all frames of a sequence that is decoded block by block, in order.

    Keeps one decoded block and `BYTES_PER_READ` of the original in memory.

    Parameters
    ----------
    decoded_blocks : iterable of float arrays of shape (T_b, V, 3)
        In the vertex order of the original.

    Raises
    ------
    InvalidInputError
        If a block has the wrong shape, or the numbers of frames differ.
    """
    n_decoded = 0
    for decoded in decoded_blocks:
        n_per_read = max(1, BYTES_PER_READ // max(1, decoded[:1].nbytes))
        for first in range(0, len(decoded), n_per_read):
            part = decoded[first : first + n_per_read]
            sums.add(original.read(n_decoded + first, n_decoded + first + len(part)), part)
        n_decoded += len(decoded)
    if n_decoded != original.n_frames:
        raise InvalidInputError(
            f"{n_decoded} frames were decoded; the original has {original.n_frames}"
        )
