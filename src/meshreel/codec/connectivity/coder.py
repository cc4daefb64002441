"""Lossless coding of the connectivity of a mesh, with or without its order.

Everything in a stream is coded in an internal vertex order, the one in which the coder of the
faces visits the vertices. Storing the given order is optional: it takes more bytes than the
connectivity itself.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import encode_order, inverse_permutation
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.cells import (
    EncodedCells,
    cell_links,
    encode_cells,
    encode_cells_order,
)
from meshreel.kernel.connectivity import encode_faces
from meshreel.kernel.order import opposite_sides
from meshreel.model.cells import Cells
from meshreel.model.geometry.triangles import matching_corners
from meshreel.model.sequence import Faces

ORDERS = ("keep", "vertices", "drop")
CELLS_AND_VERTICES = 3
"""First byte of the order of cells."""

GOOD_WALK_BYTES = 0.5
"""Bytes per face of a walk below which the plain face list is not tried."""

GOOD_LIST_BYTES = 0.05
"""Bytes per cell of a list below which a walk is not tried: it takes several times as long, and
needs the order of cells."""


@dataclass(frozen=True)
class CodedConnectivity:
    """A coded face list, and the internal vertex order."""

    payload: bytes
    """Describes `internal_faces`."""
    order_payload: bytes
    """Describes the given order of vertices and faces; empty if it is the internal one or was
    dropped.
    """
    internal_to_given: Integers
    """int64 array of shape (V,). Vertex i of the internal order is vertex ``internal_to_given[i]``
    of the input.
    """
    internal_faces: Faces
    """int32 array of shape (M, 3). The faces that a reader decodes."""
    internal_twins: npt.NDArray[np.int32]
    """int32 array of shape (3 M,). The other side at the edge of each internal side, or the side
    itself.
    """
    counts: tuple[int, ...] = ()
    """Of cells, of their nodes and of the faces of their surface, which precede the payload."""
    internal_cells: Cells | None = None
    """Cells of a volume mesh in internal order, with internal vertices."""
    cells_to_internal: Integers | None = None
    """int64 array of shape (N,). Internal number of each given cell."""
    cell_links: npt.NDArray[np.int32] | None = None
    """int32 array of shape (n, 3). Edges of the cells, as `meshreel.kernel.cells.cell_links`
    returns them.
    """

    def given_faces(self, faces: Faces) -> Integers:
        """Return the given number of each internal face, of shape (M,)."""
        internal = inverse_permutation(self.internal_to_given)[faces]
        return matching_corners(self.internal_faces, internal, len(self.internal_to_given)) // 3

    @property
    def size_bytes(self) -> int:
        """Size of both payloads."""
        return len(self.payload) + len(self.order_payload)


def encode_connectivity(faces: Faces, n_verts: int, *, order: str = "keep") -> CodedConnectivity:
    """Encode a face list as a walk over the surface or as a plain list, whichever is smaller.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
        Any triangles on vertices 0..n_verts-1: degenerate, repeated and non-manifold ones too.
    n_verts : int
        V. Vertices that no face uses are kept.
    order : {"keep", "vertices", "drop"}
        Preserve the order of vertices and faces; the vertex order, and the same oriented triangles
        in any order and rotation; or the mesh with its vertices renumbered.

    Raises
    ------
    InvalidInputError
        If `order` is none of these, or there are too many vertices or faces.
    """
    if order not in ORDERS:
        raise InvalidInputError(f"order must be one of {', '.join(ORDERS)}; got {order!r}")
    walk = _code(faces, n_verts, order, listed=False)
    if walk.size_bytes <= GOOD_WALK_BYTES * len(faces):
        return walk
    plain = _code(faces, n_verts, order, listed=True)
    return min(walk, plain, key=lambda coded: coded.size_bytes)


def _code(faces: Faces, n_verts: int, order: str, *, listed: bool) -> CodedConnectivity:
    coded = encode_faces(faces, n_verts, listed=listed)
    order_payload = b""
    if not listed and order != "drop":
        order_payload = encode_order(
            faces, coded.faces, coded.internal_to_given, keep_faces=order == "keep"
        )
    return CodedConnectivity(
        coded.data, order_payload, coded.internal_to_given, coded.faces, coded.twins
    )


def encode_mesh(
    faces: Faces, cells: Cells | None, n_verts: int, *, order: str
) -> CodedConnectivity:
    """Encode the cells of a mesh, or its faces if it has no cells.

    Cells are a list or a walk from cell to cell, whichever is smaller.

    Parameters
    ----------
    order : {"keep", "vertices", "drop"}
        As of `encode_connectivity`; for cells, "keep" or "drop".

    Raises
    ------
    InvalidInputError
        As `encode_connectivity` and `encode_cells`, or if the order of cells is "vertices".
    """
    if cells is None:
        return encode_connectivity(faces, n_verts, order=order)
    if order not in ("keep", "drop"):
        raise InvalidInputError(
            Keyword("order"), f" of a mesh of cells is keep or drop; got {order!r}"
        )
    listed = encode_cells(cells.types, cells.nodes, n_verts, listed=True)
    if order == "keep" and len(listed.data) <= GOOD_LIST_BYTES * cells.n_cells:
        return _coded_cells(listed, n_verts, b"")
    walked = encode_cells(cells.types, cells.nodes, n_verts, listed=False)
    order_payload = b""
    if order == "keep":
        order_payload = bytes([CELLS_AND_VERTICES]) + encode_cells_order(walked)
    if len(listed.data) <= len(walked.data) + len(order_payload):
        return _coded_cells(listed, n_verts, b"")
    return _coded_cells(walked, n_verts, order_payload)


def _coded_cells(coded: EncodedCells, n_verts: int, order_payload: bytes) -> CodedConnectivity:
    internal = Cells(coded.types, coded.nodes)
    surface = internal.surface(n_verts)
    counts = internal.n_cells, len(internal.nodes), len(surface.sizes)
    return CodedConnectivity(
        coded.data,
        order_payload,
        coded.internal_to_given,
        surface.triangles,
        opposite_sides(surface.triangles, n_verts),
        counts,
        internal,
        inverse_permutation(coded.given_cells),
        cell_links(internal.types, internal.nodes, n_verts),
    )
