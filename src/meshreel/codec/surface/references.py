"""Coding of references into a table; most refer to the next new row, or repeat the last one."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import write_varint
from meshreel.kernel.integers import encode_integers

Integers = npt.NDArray[np.integer]

AGAIN, NEW, ELSE = 0, 1, 2
"""Kinds of references: the last row of the same place, the next new row, any other row."""


def encode_references(rows: npt.NDArray[np.integer], places: npt.NDArray[np.integer]) -> bytes:
    """Encode the row that each item refers to.

    Parameters
    ----------
    rows : integer array of shape (N,)
        At least 0.
    places : integer array of shape (N,)
        The place of each item (its vertex, for instance), at least 0: items of one place often
        refer to the same row. The reader needs the same places.
    """
    rows = np.asarray(rows, np.int64)
    last = _last_at_place(np.asarray(places, np.int64))
    is_again = (last >= 0) & (rows[last] == rows)
    is_new = _first_references(rows) & ~is_again
    kinds = np.where(is_again, AGAIN, np.where(is_new, NEW, ELSE))
    others = rows[kinds == ELSE]
    differences = np.diff(others, prepend=0)
    # Separate tables: the first item of a place is mostly new, the others are not.
    rows_of_integers = [kinds[last < 0], kinds[last >= 0], differences]
    return write_varint(len(others)) + encode_integers(rows_of_integers)


def _last_at_place(places: Integers) -> Integers:
    """Index of the last item before each at the same place; -1 if there is none."""
    order = np.argsort(places, kind="stable")
    last = np.full(len(places), -1, np.int64)
    same = places[order[1:]] == places[order[:-1]]
    last[order[1:][same]] = order[:-1][same]
    return last


def _first_references(rows: Integers) -> npt.NDArray[np.bool_]:
    """Return whether each item is the first to refer to its row, after all lower rows."""
    is_new = np.zeros(len(rows), bool)
    if not len(rows):
        return is_new
    distinct, first = np.unique(rows, return_index=True)
    # Row r is new only if all lower rows occur before it, in ascending order.
    in_order = (distinct == np.arange(len(distinct))) & (np.diff(first, prepend=-1) > 0)
    n_new = len(distinct) if in_order.all() else int(np.argmin(in_order))
    is_new[first[:n_new]] = True
    return is_new
