"""Coder of references into a table; most refer to the next new row, or repeat the last one."""

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError

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


def decode_references(data: bytes, places: npt.NDArray[np.integer]) -> Integers:
    """Rows that `encode_references` wrote; the caller checks their range.

    Parameters
    ----------
    data : bytes
    places : integer array of shape (N,)
        The same that `encode_references` was given.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not references of this many items.
    """
    places = np.asarray(places, np.int64)
    n_others, position = read_varint(data, 0)
    if n_others > len(places):
        raise CorruptStreamError(f"{n_others} of {len(places)} references have a number")
    is_first = _last_of_place(places) < 0
    n_first = int(is_first.sum())
    lengths = [n_first, len(places) - n_first, n_others]
    first_kinds, later_kinds, differences = decode_integers(data[position:], lengths)
    kinds = np.empty(len(places), np.int64)
    kinds[is_first], kinds[~is_first] = first_kinds, later_kinds
    if len(kinds) and not AGAIN <= kinds.min() <= kinds.max() <= ELSE:
        raise CorruptStreamError("a reference is of an unknown kind")
    if int((kinds == ELSE).sum()) != n_others:
        raise CorruptStreamError("there are not as many references with a number as announced")
    rows = np.full(len(places), -1, np.int64)
    rows[kinds == NEW] = np.arange(int((kinds == NEW).sum()))
    rows[kinds == ELSE] = np.cumsum(differences)
    return _repeated(rows, kinds == AGAIN, places)


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


def _repeated(rows: Integers, is_again: npt.NDArray[np.bool_], places: Integers) -> Integers:
    """Rows in which each repetition has the row of the last item of its place that is none."""
    order = np.argsort(places, kind="stable")
    source = np.maximum.accumulate(np.where(is_again[order], -1, np.arange(len(order))))
    if ((source < 0) | (places[order[source]] != places[order])).any():
        raise CorruptStreamError("a reference repeats the last of its place, which has none")
    found = np.empty_like(rows)
    found[order] = rows[order[source]]
    return found
