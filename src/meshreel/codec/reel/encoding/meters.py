"""Errors of a trial stream, accumulated block by block."""

import math

from meshreel.codec.reel.encoding.block_coder import CodedFrames
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.metrics.reference import relative

SLACK = 1e-6
"""Relative margin of errors that are computed from fields."""


class KgMeter:
    """KG error in percent, computed from fields; frames are decoded only if errors are tiny."""

    def __init__(self) -> None:
        self._error = self._spread = 0.0

    def add(self, frames: BlockFrames, coded: CodedFrames) -> None:
        """Add the next frames, original and coded."""
        self.add_squares(coded.squared_error(frames), frames.spread)

    def add_squares(self, error: float, spread: float) -> None:
        """Add the squared errors of frames, and the squared distances from their means."""
        self._error += error
        self._spread += spread

    @property
    def value(self) -> float:
        """Error of all frames so far."""
        return 100.0 * (1.0 + SLACK) * relative(math.sqrt(self._error), math.sqrt(self._spread))
