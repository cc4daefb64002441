"""The original of a file, in the vertex order of the file."""

import threading
from collections.abc import Mapping

import numpy as np

from meshreel.arrays import Integers, Values
from meshreel.codec.dropped_order import internal_numbers
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import has_same_triangles, require_same_triangles
from meshreel.model.extent import Extent
from meshreel.model.sequence import FrameSource, Vertices
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource


class Original:
    """Frames of the original in the vertex order of the decoded file; thread-safe.

    Parameters
    ----------
    reel : ReelFile
        Without the original vertex order, vertices are matched by connectivity. A truncated file
        has the first frames of the original.

    Attributes
    ----------
    extent : Extent
        Bounding box of all frames.

    Raises
    ------
    InvalidInputError
        If the two differ in frames, vertices or faces.
    """

    def __init__(self, source: FrameSource, reel: ReelFile) -> None:
        counts = {
            "vertices": (source.n_verts, reel.n_verts),
            "faces": (len(source.faces), reel.n_faces),
            "frames": (source.n_frames, reel.n_frames),
        }
        for noun, (count, count_hat) in counts.items():
            is_cut = noun == "frames" and not reel.is_whole and count > count_hat
            if count != count_hat and not is_cut:
                raise InvalidInputError(
                    f"the original has {count} {noun} and the file {count_hat}; "
                    "give the original that was encoded"
                )
        self._source = source
        self._lock = threading.Lock()
        self._order = _original_items(source, reel)
        self.extent: Extent = source.extent

    def frame(self, number: int) -> Vertices:
        """Positions of one frame, of shape (V, 3), in model units."""
        with self._lock:  # frames may be read from an open file
            positions: Vertices = self._source.read(number, number + 1)[0]
        return positions[self._order[Domain.VERTEX]] if self._order else positions

    @property
    def tracks(self) -> Mapping[str, TrackSource]:
        """Tracks by name."""
        return self._source.tracks

    def values(self, name: str, number: int) -> Values:
        """Values of a track at a frame, of shape (N, C), in the order of the decoded file."""
        track = self._source.tracks[name]
        with self._lock:
            values: Values = track.read(number, number + 1)[0]
        return values[self._order[track.domain]] if track.domain in self._order else values


def _original_items(source: FrameSource, reel: ReelFile) -> Mapping[Domain, Integers]:
    """The original number of each decoded item; empty if the order is the same."""
    if reel.order != "drop":
        require_same_triangles(source.faces, reel.faces, reel.n_verts)
        return {}
    numbers = internal_numbers(source)
    faces = numbers[Domain.VERTEX].astype(np.int32)[source.faces]
    if not has_same_triangles(faces, reel.faces, reel.n_verts):
        raise InvalidInputError(
            "the original has other faces than the file, or lists them in another order; the file "
            "does not store the vertex order, so give exactly the input that was encoded"
        )
    return {domain: np.argsort(items) for domain, items in numbers.items()}
