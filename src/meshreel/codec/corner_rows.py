"""Rows of values that corners of faces share in a track.

Row v belongs to the first corner of internal vertex v, and to its corners with equal values. At a
seam, a vertex has further rows, which follow those of all vertices. See `docs/format.md`, "Tracks".
"""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.bitstream.container import write_varint
from meshreel.kernel.integers import encode_integers

PREVIOUS, NEW = 0, 1
"""Codes of the row of the previous corner at the vertex, and of a new row. A larger code k refers
to the row of the k-th previous corner."""


@dataclass(frozen=True)
class CornerRows:
    """Row of each corner."""

    of_corners: Integers
    """int64 array of shape (N,). Row of each corner."""
    n_rows: int
    """Number of rows, R; at least the number of vertices."""


def number_rows(groups: Integers, vertices: Integers, n_verts: int) -> CornerRows:
    """Number the rows of groups of corners.

    Parameters
    ----------
    groups : integer array of shape (N,)
        At least 0; corners of a group have the same vertex, and equal values in all frames.
    vertices : integer array of shape (N,)
        Internal number of the vertex of each corner.
    """
    order, ranks = _by_vertex(vertices)
    rows = np.full(int(groups.max(initial=-1)) + 1, -1, np.int64)
    first = order[ranks == 0]
    rows[groups[first]] = vertices[first]
    sorted_groups = groups[order]
    _, firsts = np.unique(sorted_groups, return_index=True)
    by_occurrence = sorted_groups[np.sort(firsts)]
    new_groups = by_occurrence[rows[by_occurrence] < 0]
    rows[new_groups] = n_verts + np.arange(len(new_groups))
    return CornerRows(rows[groups], n_verts + len(new_groups))


def write_corner_rows(rows: CornerRows, vertices: Integers, n_verts: int) -> bytes:
    """Encode the rows of `number_rows`; the reader needs the same vertices."""
    has_seam = np.zeros(n_verts, np.int64)
    has_seam[vertices[rows.of_corners >= n_verts]] = 1
    order, ranks = _by_vertex(vertices)
    of_corners = rows.of_corners[order]
    by_row = np.argsort(of_corners, kind="stable")
    is_same = of_corners[by_row[1:]] == of_corners[by_row[:-1]]
    codes = np.full(len(order), NEW, np.int64)
    distances = by_row[1:][is_same] - by_row[:-1][is_same]
    codes[by_row[1:][is_same]] = np.where(distances == 1, PREVIOUS, distances)
    stored_codes = codes[(ranks > 0) & (has_seam[vertices[order]] > 0)]
    return write_varint(len(stored_codes)) + encode_integers([has_seam, stored_codes])


def _by_vertex(vertices: Integers) -> tuple[Integers, Integers]:
    """Sort corners by vertex; also return the rank of each among the corners of its vertex."""
    order = np.argsort(vertices, kind="stable")
    sorted_vertices = vertices[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = sorted_vertices[1:] != sorted_vertices[:-1]
    numbers = np.arange(len(order))
    return order, numbers - np.maximum.accumulate(np.where(is_first, numbers, 0))
