"""Errors of a trial stream, gathered block after block as it is made."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from meshreel.metrics.sted import sted
from meshreel.metrics.streamed import ErrorSums
from meshreel.sequence import Extent, Faces

Vertices = npt.NDArray[np.floating]


class Meter(Protocol):
    """An error that is gathered over the blocks of a sequence."""

    def add(self, original: Vertices, decoded: Vertices) -> None:
        """Take in the next frames, of shape (T_b, V, 3)."""

    @property
    def value(self) -> float:
        """The error of all frames so far."""


class KgMeter:
    """KG error in percent.

    Parameters
    ----------
    extent : Extent
        Of the whole original sequence.
    """

    def __init__(self, extent: Extent) -> None:
        self._sums = ErrorSums(extent)

    def add(self, original: Vertices, decoded: Vertices) -> None:
        """Take in the next frames, of shape (T_b, V, 3)."""
        self._sums.add(original, decoded)

    @property
    def value(self) -> float:
        """The error of all frames so far."""
        return self._sums.errors.kg_error_percent


class StedMeter:
    """STED, which compares frames across blocks: it keeps them all.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    """

    def __init__(self, faces: Faces) -> None:
        self._faces = faces
        self._blocks: list[tuple[Vertices, Vertices]] = []

    def add(self, original: Vertices, decoded: Vertices) -> None:
        """Take in the next frames, of shape (T_b, V, 3)."""
        self._blocks.append((original, decoded))

    @property
    def value(self) -> float:
        """The error of all frames so far."""
        original, decoded = map(np.concatenate, zip(*self._blocks, strict=True))
        return sted(original, decoded, self._faces).sted
