"""Lossless coding of the connectivity of a mesh, with or without its order.

Everything in a stream is coded in an internal vertex order, the one in which the coder of the
faces visits the vertices. Storing the given order is optional: it takes more bytes than the
connectivity itself.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import encode_order
from meshreel.errors import InvalidInputError
from meshreel.kernel.connectivity import encode_faces
from meshreel.model.sequence import Faces

ORDERS = ("keep", "vertices", "drop")
GOOD_WALK_BYTES = 0.5
"""Bytes per face of a walk below which the plain face list is not tried."""


@dataclass(frozen=True)
class CodedConnectivity:
    """A coded face list, and the internal vertex order.

    Attributes
    ----------
    payload : bytes
        Describes `internal_faces`.
    order_payload : bytes
        Describes the given order of vertices and faces; empty if it is the internal one or was
        dropped.
    internal_to_given : int64 array of shape (V,)
        Vertex i of the internal order is vertex ``internal_to_given[i]`` of the input.
    internal_faces : int32 array of shape (M, 3)
        The faces that a reader decodes.
    internal_twins : int32 array of shape (3 M,)
        The other side at the edge of each internal side, or the side itself.
    """

    payload: bytes
    order_payload: bytes
    internal_to_given: Integers
    internal_faces: Faces
    internal_twins: npt.NDArray[np.int32]

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
    walked = _code(faces, n_verts, order, listed=False)
    if walked.size_bytes <= GOOD_WALK_BYTES * len(faces):
        return walked
    listed = _code(faces, n_verts, order, listed=True)
    return min(walked, listed, key=lambda coded: coded.size_bytes)


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
