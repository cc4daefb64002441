"""Coder of references into a table; most refer to the next new row, or repeat the last one."""

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import write_varint
from meshreel.kernel.integers import encode_integers

Integers = npt.NDArray[np.integer]

AGAIN, NEW, ELSE = 0, 1, 2
"""Kinds of references: the last row of the same place again, the next new row, a number."""


def encode_references(rows: npt.NDArray[np.integer], places: npt.NDArray[np.integer]) -> bytes:
    """Bytes of the row that each item refers to.

    Parameters
    ----------
    rows : integer array of shape (N,)
        At least 0.
    places : integer array of shape (N,)
        The place of each item (its vertex, for instance), at least 0: items of one place often
        refer to the same row. The reader needs the same places.
    """
    rows = np.asarray(rows, np.int64)
    last = _last_of_place(np.asarray(places, np.int64))
    is_again = (last >= 0) & (rows[last] == rows)
    is_new = _is_new(rows) & ~is_again
    kinds = np.where(is_again, AGAIN, np.where(is_new, NEW, ELSE))
    others = rows[kinds == ELSE]
    differences = np.diff(others, prepend=0)
    # The first item of a place is mostly new and the others are not: each have their own table.
    rows_of_integers = [kinds[last < 0], kinds[last >= 0], differences]
    return write_varint(len(others)) + encode_integers(rows_of_integers)


def _last_of_place(places: Integers) -> Integers:
    """Index of the last item before each at the same place; -1 if there is none."""
    order = np.argsort(places, kind="stable")
    last = np.full(len(places), -1, np.int64)
    same = places[order[1:]] == places[order[:-1]]
    last[order[1:][same]] = order[:-1][same]
    return last


def _is_new(rows: Integers) -> npt.NDArray[np.bool_]:
    """Whether each item is the first to refer to its row, after all lower rows."""
    is_new = np.zeros(len(rows), bool)
    if not len(rows):
        return is_new
    named, first = np.unique(rows, return_index=True)
    # Row r is the r-th new one only if all rows below are, each named before the next.
    in_turn = (named == np.arange(len(named))) & (np.diff(first, prepend=-1) > 0)
    n_in_turn = len(named) if in_turn.all() else int(np.argmin(in_turn))
    is_new[first[:n_in_turn]] = True
    return is_new
