"""Triangle strips of PLY files: every vertex makes a triangle with the two before it."""

import numpy as np

from meshreel.geometry.ragged import Integers

RESTART = -1
"""In place of a vertex: the next one begins a new strip."""


def cut_strips(lengths: Integers, values: Integers) -> Integers:
    """The triangles of strips, of shape (M, 3), all facing the same side of their strip.

    Parameters
    ----------
    lengths : integer array
        How many values each list has; a list begins a new strip.
    values : integer array of shape (sum of lengths,)
        Vertices, and `RESTART` between strips.
    """
    corners = values.astype(np.int64)
    places = np.arange(len(corners))
    is_restart = corners == RESTART
    lists = np.repeat(np.arange(len(lengths)), lengths)
    is_first = np.diff(lists, prepend=-1) > 0
    is_first[1:] |= is_restart[:-1]
    begin = np.maximum.accumulate(np.where(is_first, places, 0))
    first = places[: max(0, len(corners) - 2)]
    # The third vertex is of the same strip, which has no restart in it then.
    first = first[(begin[first + 2] <= first) & ~is_restart[first + 2]]
    is_turned = (first - begin[first]) % 2
    return np.stack(
        [corners[first], corners[first + 1 + is_turned], corners[first + 2 - is_turned]], axis=1
    )
