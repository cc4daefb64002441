"""KG error: the deviation of a sequence, relative to its spread about the frame centers."""

import math
from collections.abc import Sequence

from meshreel.metrics.frame_sums import FrameSums, sums_of_frames
from meshreel.metrics.reference import relative, shared_reference
from meshreel.model.sequence import Vertices


class KgSums:
    """Accumulator of squared error and spread over frames."""

    def __init__(self) -> None:
        self._error = self._spread = 0.0

    def add(self, frames: Sequence[FrameSums]) -> None:
        """Add frames; all must use the same reference."""
        for frame in frames:
            self._error += frame.error
            self._spread += frame.spread

    @property
    def percent(self) -> float:
        """The KG error of the frames so far, as `kg_error_percent` defines it."""
        return 100 * relative(math.sqrt(self._error), math.sqrt(self._spread))


def kg_error_percent(original: Vertices, decoded: Vertices) -> float:
    """KG error in percent, ``100 ||G - G^||_F / ||G - E(G)||_F`` over all frames.

    E(G) replaces every vertex by the mean vertex of its frame. The error is invariant to moving or
    scaling both sequences alike.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Returns
    -------
    float, in percent. If all vertices coincide within each original frame, the spread is 0 and
    the error is 0 for an identical decoded sequence, infinite otherwise.

    Raises
    ------
    InvalidInputError
        If the shapes differ.

    Source: Karni and Gotsman, "Spectral compression of mesh geometry", SIGGRAPH 2000, and the
    form for sequences in their "Compression of soft-body animation sequences", 2004.
    """
    sums = KgSums()
    sums.add(sums_of_frames(original, decoded, shared_reference(original, decoded)))
    return sums.percent
