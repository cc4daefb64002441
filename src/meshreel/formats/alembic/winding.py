"""The order of corners: Alembic's faces are clockwise seen from outside, meshreel's are not."""

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.ragged import Integers


def turned_corners(counts: Integers) -> npt.NDArray[np.int64]:
    """The corners of each face from its last to its first; its own inverse.

    The first corner becomes the last, as Blender has it too.

    Parameters
    ----------
    counts : integer array of shape (N,)
        Corners of each face.

    Returns
    -------
    int64 array of shape (sum of counts,), indices of corners that are counted face after face.
    """
    lengths = np.asarray(counts, np.int64)
    ends = np.cumsum(lengths)
    mirrored = np.repeat(2 * ends - lengths - 1, lengths)  # first and last corner of a face
    return mirrored - np.arange(len(mirrored), dtype=np.int64)
