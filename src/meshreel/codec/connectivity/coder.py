"""Lossless coding of the connectivity of a mesh, with or without its order.

Everything in a stream is coded in an internal vertex order, the one in which the coder of the
faces visits the vertices. Storing the given order is optional: it takes more bytes than the
connectivity itself.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import decode_given_order, encode_order
from meshreel.errors import InvalidInputError
from meshreel.kernel.connectivity import decode_faces, encode_faces
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
        The faces that `decode_connectivity` returns.
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


def decode_connectivity(payload: bytes, n_verts: int, n_faces: int) -> Faces:
    """Decode the internal faces, int32 of shape (M, 3).

    Parameters
    ----------
    payload : bytes
        From `encode_connectivity`, or untrusted: every byte is checked.
    n_verts, n_faces : int
        V and M, which the caller has bounded.

    Raises
    ------
    CorruptStreamError
        If the payload is damaged or disagrees with `n_verts` or `n_faces`.
    """
    return decode_faces(payload, n_verts, n_faces)


def decode_order(
    order_payload: bytes, internal_faces: Faces, n_verts: int
) -> tuple[Integers, Faces]:
    """Decode `internal_to_given` and the faces in the given order.

    Parameters
    ----------
    order_payload : bytes
        From `encode_connectivity`; empty if only the internal order is known.
    internal_faces : int32 array of shape (M, 3)
        From `decode_connectivity`.

    Raises
    ------
    CorruptStreamError
        If the payload is damaged or belongs to another mesh.
    """
    if not order_payload:
        return np.arange(n_verts), internal_faces
    return decode_given_order(order_payload, internal_faces, n_verts)


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
