"""Which corners of faces always have equal values: the rows that a track of corners is coded by.

Each vertex has a row, of its first corner, with the number of the vertex in internal order; where
its corners differ, at a seam, further rows follow. `docs/format.md`, "Tracks".
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]

AGAIN, NEW = 0, 1
"""The row of the corner before at the vertex; one that has not come. A larger code k is the row of
the corner k before."""


@dataclass(frozen=True)
class CornerRows:
    """The row of each corner.

    Attributes
    ----------
    of_corners : int64 array of shape (N,)
    n_rows : int
        R; at least the number of vertices.
    """

    of_corners: Integers
    n_rows: int


def numbered_rows(groups: Integers, vertices: Integers, n_verts: int) -> CornerRows:
    """The rows of corners that are in groups.

    Parameters
    ----------
    groups : integer array of shape (N,)
        From 0 on; corners of a group have one vertex, and always equal values.
    vertices : integer array of shape (N,)
        Internal number of the vertex of each corner.
    n_verts : int
    """
    order, places = _by_vertex(vertices)
    found = np.full(int(groups.max(initial=-1)) + 1, -1, np.int64)
    first = order[places == 0]
    found[groups[first]] = vertices[first]
    others = groups[order]
    _, at = np.unique(others, return_index=True)
    others = others[np.sort(at)]
    others = others[found[others] < 0]
    found[others] = n_verts + np.arange(len(others))
    return CornerRows(found[groups], n_verts + len(others))


def write_corner_rows(rows: CornerRows, vertices: Integers, n_verts: int) -> bytes:
    """Bytes of the rows that `numbered_rows` gave; the reader needs the same vertices."""
    has_seam = np.zeros(n_verts, np.int64)
    has_seam[vertices[rows.of_corners >= n_verts]] = 1
    order, places = _by_vertex(vertices)
    of_corners = rows.of_corners[order]
    by_row = np.argsort(of_corners, kind="stable")
    is_same = of_corners[by_row[1:]] == of_corners[by_row[:-1]]
    codes = np.full(len(order), NEW, np.int64)
    back = by_row[1:][is_same] - by_row[:-1][is_same]
    codes[by_row[1:][is_same]] = np.where(back == 1, AGAIN, back)
    stored = codes[(places > 0) & (has_seam[vertices[order]] > 0)]
    return write_varint(len(stored)) + encode_integers([has_seam, stored])


def read_corner_rows(payload: bytes, vertices: Integers, n_verts: int) -> CornerRows:
    """Undo `write_corner_rows`.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the bytes are not the rows of corners of these vertices.
    """
    n_stored, position = read_varint(payload, 0)
    if n_stored > len(vertices):
        raise CorruptStreamError(f"{n_stored} of {len(vertices)} corners have a row of their own")
    has_seam, stored = decode_integers(payload[position:], [n_verts, n_stored])
    if ((has_seam < 0) | (has_seam > 1)).any():
        raise CorruptStreamError("a vertex neither has a seam nor has none")
    order, places = _by_vertex(vertices)
    is_stored = (places > 0) & (has_seam[vertices[order]] > 0)
    if int(is_stored.sum()) != n_stored:
        raise CorruptStreamError("there are not as many corners at seams as announced")
    codes = np.full(len(order), AGAIN, np.int64)
    codes[is_stored] = stored
    back = np.where(codes == AGAIN, 1, codes)
    if ((codes < 0) | ((codes != NEW) & (places > 0) & (back > places))).any():
        raise CorruptStreamError("a corner has the row of a corner that its vertex does not have")
    is_new = (codes == NEW) & (places > 0)
    numbers = np.arange(len(order))
    source = np.where(is_new | (places == 0), numbers, numbers - back)
    while (source[source] != source).any():
        source = source[source]
    found = np.where(is_new, n_verts - 1 + np.cumsum(is_new), vertices[order])[source]
    of_corners = np.empty(len(order), np.int64)
    of_corners[order] = found
    return CornerRows(of_corners, n_verts + int(is_new.sum()))


def _by_vertex(vertices: Integers) -> tuple[Integers, Integers]:
    """Corners by their vertices, ascending; and how many corners of its vertex are before each."""
    order = np.argsort(vertices, kind="stable")
    sorted_vertices = vertices[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = sorted_vertices[1:] != sorted_vertices[:-1]
    numbers = np.arange(len(order))
    return order, numbers - np.maximum.accumulate(np.where(is_first, numbers, 0))
