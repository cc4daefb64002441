"""Number type and extent of all frames, found before a sequence is returned."""

from collections.abc import Iterable, Iterator

import numpy as np

from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Corners, Extent, Vertices, bounding_boxes, extent_of_boxes


class FrameSurvey:
    """Accumulates the number type and extent of frames.

    Parameters
    ----------
    is_decimal : bool, default False
        Whether positions are decimal text without a declared type.
    """

    def __init__(self, *, is_decimal: bool = False) -> None:
        self._widest: np.dtype[np.floating] = np.dtype(np.float32)
        self._boxes: list[tuple[Corners, Corners]] = []
        self._narrowing = Narrowing() if is_decimal else None

    def add(self, vertices: Vertices) -> None:
        """Add frames: finite positions of shape (T, V, 3)."""
        self._widest = np.promote_types(self._widest, vertices.dtype)
        self._boxes.append(bounding_boxes(vertices))
        if self._narrowing is not None:
            for frame in vertices:
                self._narrowing.add(frame)

    def watch(self, frames: Iterable[Vertices]) -> Iterator[Vertices]:
        """Yield the given frames, of shape (V, 3), adding each."""
        for frame in frames:
            self.add(frame[np.newaxis])
            yield frame

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """The widest type of the frames; float32 for decimal text if that is precise enough."""
        narrow = self._narrowing is not None and self._narrowing.is_harmless
        return np.dtype(np.float32) if narrow else self._widest

    @property
    def extent(self) -> Extent:
        """The extent of the frames in `dtype`."""
        # Rounding is monotonic, so the box of rounded positions is the rounded box.
        low, high = (
            np.concatenate(corners).astype(self.dtype).astype(np.float64)
            for corners in zip(*self._boxes, strict=True)
        )
        return extent_of_boxes(low, high)
