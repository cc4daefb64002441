"""Index arithmetic on ragged arrays: polygons, lines of text, lists in a PLY file."""

from typing import Any

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.integer[Any]]


def ragged_indices(starts: Integers, counts: Integers) -> npt.NDArray[np.int64]:
    """Concatenated indices of the ranges ``starts[i] .. starts[i] + counts[i] - 1``.

    Parameters
    ----------
    starts, counts : integer arrays of shape (N,)
        First index and length of each range; lengths are at least 0.

    Returns
    -------
    int64 array of shape (sum of counts,).
    """
    lengths = np.asarray(counts, dtype=np.int64)
    ends = np.cumsum(lengths)
    total = int(ends[-1]) if len(ends) else 0
    return np.repeat(starts - (ends - lengths), lengths) + np.arange(total, dtype=np.int64)
