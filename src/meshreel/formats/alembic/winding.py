"""Corner order: faces are clockwise from outside in Alembic, counterclockwise in meshreel."""

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.polygons import Integers


def reversed_corners(counts: Integers) -> npt.NDArray[np.int64]:
    """Return the permutation that reverses the corners of each face; it is its own inverse.

    The first corner becomes the last, as in Blender.

    Parameters
    ----------
    counts : integer array of shape (N,)
        Corners of each face.

    Returns
    -------
    int64 array of shape (sum of counts,), corner indices.
    """
    lengths = np.asarray(counts, np.int64)
    ends = np.cumsum(lengths)
    # In a face, an index and its mirror image add up to the first index plus the last.
    first_plus_last = np.repeat(2 * ends - lengths - 1, lengths)
    return first_plus_last - np.arange(len(first_plus_last), dtype=np.int64)
