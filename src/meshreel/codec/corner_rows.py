"""Which corners of faces always have equal values: the rows that a track of corners is coded by.

Each vertex has a row, of its first corner, with the number of the vertex in internal order; where
its corners differ, at a seam, further rows follow. `docs/format.md`, "Tracks".
"""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.bitstream.container import write_varint
from meshreel.kernel.integers import encode_integers

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


def _by_vertex(vertices: Integers) -> tuple[Integers, Integers]:
    """Corners by their vertices, ascending; and how many corners of its vertex are before each."""
    order = np.argsort(vertices, kind="stable")
    sorted_vertices = vertices[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = sorted_vertices[1:] != sorted_vertices[:-1]
    numbers = np.arange(len(order))
    return order, numbers - np.maximum.accumulate(np.where(is_first, numbers, 0))
