"""Decimal text for numbers that round-trips exactly, and detection of float32."""

import math
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.model.extent import bounding_boxes
from meshreel.model.sequence import Vertices

FLOAT32_TOLERANCE = 1e-6  # of the model's size; float32 itself keeps 6e-8 of the coordinate
# Nine digits have an error of 5e-9 of the coordinate: half the tolerance at this distance.
NEAR_DIAGONALS = 100
BLOCK_ROWS = 1 << 16  # rows formatted at a time


def vertex_rows(
    vertices: Vertices, *, prefix: str = "", suffixes: Sequence[str] | None = None
) -> bytes:
    """Return a line ``x y z`` for each vertex, with enough digits to round-trip exactly.

    Nine digits are enough for float32. Float64 gets the shortest exact text, and so does float32
    far from the origin, so that `Narrowing` recognizes it.

    Parameters
    ----------
    vertices : float32 or float64 array of shape (V, 3)
        Positions in model units, finite.
    prefix : str, default ""
        Start of every line.
    suffixes : sequence of V str, optional
        Rest of each line, after a blank; without percent signs.
    """
    if len(vertices) == 0:
        return b""
    with np.errstate(over="ignore"):
        is_near = np.abs(vertices).max() <= NEAR_DIAGONALS * _diagonal(vertices)
    number = "%.9g" if vertices.dtype == np.float32 and is_near else "%r"
    line = f"{prefix}{number} {number} {number}"
    pieces = []
    for start in range(0, len(vertices), BLOCK_ROWS):
        rows = vertices[start : start + BLOCK_ROWS]
        template = f"{line}\n" * len(rows)
        if suffixes is not None:
            ends = suffixes[start : start + BLOCK_ROWS]
            template = "".join(f"{line} {suffix}\n" for suffix in ends)
        pieces.append((template % tuple(rows.ravel().tolist())).encode("ascii"))
    return b"".join(pieces)


def number_rows(values: npt.NDArray[Any]) -> list[str]:
    """Format each row of values with the fewest digits that round-trip exactly."""
    return [" ".join(map(str, row)) for row in values]


def face_rows(counts: npt.NDArray[np.integer], corners: Iterable[str]) -> list[str]:
    """Join the words of the corners of each face, given the corner counts."""
    words = iter(corners)
    return [" ".join(islice(words, count)) for count in counts.tolist()]


class Narrowing:
    """Decides whether float32 is precise enough for positions read from decimal text.

    Decimal text does not declare its precision. Nearly all files were written from float32; only
    models far from the origin, relative to their size, need float64.
    """

    def __init__(self) -> None:
        self._size = self._change = 0.0

    def add(self, frame: Vertices) -> None:
        """Add a frame: finite positions of shape (V, 3), in model units; V may be 0."""
        if not len(frame):
            return
        with np.errstate(over="ignore"):
            self._size = max(self._size, _diagonal(frame))
            if frame.dtype != np.float32:
                change = np.abs(frame - frame.astype(np.float32)).max()
                self._change = max(self._change, float(change))

    @property
    def is_harmless(self) -> bool:
        """Whether float32 moves no coordinate by more than 1e-6 of the model's size.

        The size is the largest diagonal of the bounding box of a frame.
        """
        return math.isfinite(self._change) and self._change <= FLOAT32_TOLERANCE * self._size


def _diagonal(frame: Vertices) -> float:
    """Diagonal of the bounding box of positions of shape (V, 3)."""
    (low,), (high,) = bounding_boxes(frame[np.newaxis])
    return math.hypot(*(high - low).tolist())
