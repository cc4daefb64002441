"""Errors of a trial stream, accumulated block by block."""

import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.block_coder import CodedFrames
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.metrics.reference import relative
from meshreel.metrics.sted import sted
from meshreel.model.sequence import Faces

Vertices = npt.NDArray[np.floating]


SLACK = 1e-6
"""Relative margin of errors that are computed from fields."""


class Meter(Protocol):
    """Accumulates an error over the blocks of a sequence."""

    def add(self, frames: BlockFrames, coded: CodedFrames) -> None:
        """Add the next frames, original and coded."""

    @property
    def value(self) -> float:
        """Error of all frames so far."""


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


class StedMeter:
    """STED; it compares frames across blocks and therefore keeps all of them.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    """

    def __init__(self, faces: Faces) -> None:
        self._faces = faces
        self._blocks: list[tuple[Vertices, Vertices]] = []

    def add(self, frames: BlockFrames, coded: CodedFrames) -> None:
        """Add the next frames, original and coded."""
        self._blocks.append((frames.internal_vertices, coded.decoded(frames)))

    @property
    def value(self) -> float:
        """Error of all frames so far."""
        if len(self._blocks) == 1:
            return sted(*self._blocks[0], self._faces).sted
        original, decoded = map(np.concatenate, zip(*self._blocks, strict=True))
        return sted(original, decoded, self._faces).sted
