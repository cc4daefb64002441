"""The extent of all frames of a file, without decoding all."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.reel_file import ReelFile

MOST_FRAMES, MOST_POSITIONS = 48, 1 << 23
"""Of the first block, at most so many stand for all where the outermost positions are sought."""

DIRECTIONS = np.array([d for d in product((-1, 0, 1), repeat=3) if d > (0, 0, 0)], np.float32)
"""13 lines through the middle of a cube: the outermost positions along them frame a mesh."""


@dataclass(frozen=True)
class Reach:
    """The space that a camera has to show.

    Attributes
    ----------
    low, high : float64 arrays of shape (3,)
        Corners of the bounding box of all frames, in model units.
    swept : float64 array of shape (26, 3)
        The outermost positions of all frames, in model units.
    """

    low: Floats
    high: Floats
    swept: Floats


def reach_of(reel: ReelFile) -> Reach:
    """How far all frames of a file reach.

    Of a file of several blocks only the first one is decoded: the space that it sweeps is widened
    about the centre of the whole until its box has the diagonal of the whole, which the stream
    records. Frames of an encoder that did not know them all may reach farther.

    Raises
    ------
    CorruptStreamError
        If the first block is damaged.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    drawn = np.unique(reel.faces)  # vertices without a face are not seen
    swept = np.zeros((0, 3))
    stop = reel.starts[1]
    n_sought = int(np.clip(MOST_POSITIONS // reel.n_verts, 2, MOST_FRAMES))
    sought = set(np.linspace(0, stop - 1, n_sought).round().astype(int).tolist())
    for start, frames in reel.pieces(range(stop)):
        low = np.minimum(low, frames.min(axis=(0, 1)))
        high = np.maximum(high, frames.max(axis=(0, 1)))
        for number in sought.intersection(range(start, start + len(frames))):
            frame = frames[number - start][drawn].astype(np.float64)
            swept = outermost(np.concatenate([swept, outermost(frame)]))
    if len(reel.starts) == 2:
        return Reach(low, high, swept)
    origin = np.array(reel.frame.origin)
    reach = np.maximum(np.abs(low - origin), np.abs(high - origin))
    length = float(np.linalg.norm(reach))
    factor = max(1.0, reel.frame.scale / 2 / length) if length > 0 else 1.0
    reach *= factor
    return Reach(origin - reach, origin + reach, origin + factor * (swept - origin))


def outermost(points: Floats) -> Floats:
    """The outermost of points of shape (N, 3), N at least 1, along each of the `DIRECTIONS`.

    Of shape (26, 3); some may be the same.
    """
    along = (points - points[0]).astype(np.float32) @ DIRECTIONS.T  # moved, to keep digits
    found: Floats = points[np.concatenate([along.argmin(axis=0), along.argmax(axis=0)])]
    return found
