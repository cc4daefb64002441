"""Vertex displacement errors, relative to the size of the sequence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from meshreel.metrics.frame_sums import FrameSums, sums_of_frames
from meshreel.metrics.reference import relative, shared_reference
from meshreel.model.sequence import Vertices


@dataclass(frozen=True)
class DisplacementErrors:
    """Vertex displacements in percent of the diagonal of the whole original sequence.

    Attributes
    ----------
    rms_percent : float
        Root of the mean squared displacement over all vertices and frames.
    max_percent : float
        Largest displacement of any vertex in any frame.
    """

    rms_percent: float
    max_percent: float


class DisplacementSums:
    """Accumulator of squared displacements over frames.

    Parameters
    ----------
    diagonal_scaled : float
        Diagonal of the bounding box of the whole original, in the units of the displacements.
    """

    def __init__(self, diagonal_scaled: float) -> None:
        self._diagonal = diagonal_scaled
        self._total = self._largest = 0.0
        self._n_positions = 0

    def add(self, frames: Sequence[FrameSums]) -> None:
        """Add frames."""
        for frame in frames:
            self._total += frame.error
            self._largest = max(self._largest, frame.largest)
            self._n_positions += frame.n_verts

    @property
    def errors(self) -> DisplacementErrors:
        """The errors of the frames so far; needs at least one frame."""
        mean = self._total / self._n_positions
        return DisplacementErrors(
            rms_percent=100 * relative(math.sqrt(mean), self._diagonal),
            max_percent=100 * relative(math.sqrt(self._largest), self._diagonal),
        )


def displacement_errors_percent(original: Vertices, decoded: Vertices) -> DisplacementErrors:
    """RMS and largest vertex displacement, in percent of the bounding-box diagonal.

    The box encloses all frames of the original. If it has no extent, every error above 0 is
    infinite.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    reference = shared_reference(original, decoded)
    sums = DisplacementSums(reference.diagonal_scaled)
    sums.add(sums_of_frames(original, decoded, reference))
    return sums.errors
