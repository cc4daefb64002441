"""Rows of attribute tables: prediction along faces, sharing by corners, and references to them."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import rows_as_bytes
from meshreel.codec.bitstream.container import write_varint
from meshreel.kernel.corner_rows import N_CONTEXTS, corner_codes
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Domain, Surface

Integers = npt.NDArray[np.integer]
Faces = npt.NDArray[np.int32]

REPEAT, NEW, EXPLICIT = 0, 1, 2
"""Codes of items: the row of the previous item, the next new row, any other row."""


def faces_of_rows(
    domain: Domain, rows: Integers | None, surface: Surface, faces: Faces
) -> Faces | None:
    """Return the rows of an attribute at the corners of each triangle, or None for faces and cells.

    Parameters
    ----------
    rows : integer array or None
        The row of each vertex or corner; None if row i belongs to item i.
    faces : int32 array of shape (M, 3)
    """
    if domain in (Domain.FACE, Domain.CELL):
        return None
    sizes = surface.sizes(len(faces))
    corners = faces if domain is Domain.VERTEX else triangle_corners(sizes, faces)
    row_faces = corners if rows is None else np.asarray(rows)[corners]
    return row_faces.astype(np.int32)


def distinct_rows(values: npt.NDArray[np.generic], groups: Integers) -> tuple[Integers, Integers]:
    """Return the first item of each distinct value in each group, and the value of each item.

    Values are equal if their bits are.
    """
    records = rows_as_bytes(groups.astype(np.int64), values)
    _, first, number = np.unique(records, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    return first[order], rank[number]


def sharing_groups(domain: Domain, surface: Surface, faces: Faces, n_items: int) -> Integers:
    """Return the group of items that may share a value: the vertex of a corner, else 0."""
    if domain is not Domain.CORNER:
        return np.zeros(n_items, np.int64)
    return join_triangles(surface.sizes(len(faces)), faces)


def encode_references(rows: Integers) -> bytes:
    """Encode the row of each vertex or face; at least 0."""
    rows = np.asarray(rows, np.int64)
    distinct, first = np.unique(rows, return_index=True)
    # Row r is new only if all lower rows occur before it, in ascending order.
    in_order = (distinct == np.arange(len(distinct))) & (np.diff(first, prepend=-1) > 0)
    n_new = len(distinct) if in_order.all() else int(np.argmin(in_order))
    codes = np.full(len(rows), EXPLICIT)
    codes[first[:n_new]] = NEW
    codes[np.diff(rows, prepend=-1) == 0] = REPEAT
    explicit = rows[codes == EXPLICIT]
    return write_varint(len(explicit)) + encode_integers([codes, np.diff(explicit, prepend=0)])


def encode_corner_references(
    rows: Integers, surface: Surface, faces: npt.NDArray[np.int32]
) -> bytes:
    """Encode the row of each corner of the polygons of a surface.

    A corner mostly has the row of a neighboring face at the same vertex; docs/format.md,
    "References of corners".

    Parameters
    ----------
    rows : integer array of shape (N,)
        At least 0.
    faces : int32 array of shape (M, 3)
        The triangles of the polygons.
    """
    sizes = surface.face_sizes
    items = None if sizes is None else triangle_corners(sizes, faces)
    n_verts = int(faces.max()) + 1
    order, contexts, codes = corner_codes(
        faces, opposite_sides(faces, n_verts), items, rows, n_verts
    )
    by_context = [codes[contexts == number] for number in range(N_CONTEXTS)]
    explicit = np.asarray(rows, np.int64)[order[codes == EXPLICIT]]
    counts = [*map(len, by_context[1:]), len(explicit)]
    differences = np.diff(explicit, prepend=0)
    return b"".join(map(write_varint, counts)) + encode_integers([*by_context, differences])
