"""How far the frames of a file reach."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel_file import ReelFile

Floats = npt.NDArray[np.float64]


def box_of(reel: ReelFile) -> tuple[Floats, Floats]:
    """Lowest and highest corner of the bounding box of all frames, in model units.

    Of a file of several blocks only the first one is decoded: its box is widened about the centre
    of the whole until it has the diagonal of the whole, which the stream tells. Frames of an
    encoder that did not know them all may reach farther.

    Parameters
    ----------
    reel : ReelFile

    Raises
    ------
    CorruptStreamError
        If the first block is damaged.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for _, frames in reel.pieces(range(reel.starts[1])):
        low = np.minimum(low, frames.min(axis=(0, 1)))
        high = np.maximum(high, frames.max(axis=(0, 1)))
    if len(reel.starts) == 2:
        return low, high
    origin = np.array(reel.frame.origin)
    reach = np.maximum(np.abs(low - origin), np.abs(high - origin))
    length = float(np.linalg.norm(reach))
    reach *= max(1.0, reel.frame.scale / 2 / length) if length > 0 else 1.0
    return origin - reach, origin + reach
