"""Lossless coder of the connectivity of a mesh, with or without its order.

Everything in a stream is coded in an internal vertex order, the one in which the coder of the
faces visits the vertices. Storing the given order is optional: it takes more bytes than the
connectivity itself.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.edgebreaker_extent import STANDARD, VALENCE
from meshreel.connectivity.general import decode_face_list, encode_face_list
from meshreel.connectivity.order import decode_given_order, encode_order
from meshreel.connectivity.traversal import decode_traversal, encode_traversal
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.runtime.profiling import staged
from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]

AS_LISTED, TRAVERSED_STANDARD, TRAVERSED_VALENCE = range(3)
"""First byte of the payload: the face list as it is, or a traversal with one of two codings."""

KIND_OF_CODING = {STANDARD: TRAVERSED_STANDARD, VALENCE: TRAVERSED_VALENCE}
CODING_OF_KIND = {kind: coding for coding, kind in KIND_OF_CODING.items()}
ORDERS = ("keep", "vertices", "drop")


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
    """

    payload: bytes
    order_payload: bytes
    internal_to_given: Integers
    internal_faces: Faces

    @property
    def size_bytes(self) -> int:
        """Size of both payloads."""
        return len(self.payload) + len(self.order_payload)


@staged("connectivity")
def encode_connectivity(faces: Faces, n_verts: int, *, order: str = "keep") -> CodedConnectivity:
    """The coded face list: the smallest of the codings that this package has.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
        Any triangles on vertices 0..n_verts-1: degenerate, repeated and non-manifold ones too.
    n_verts : int
        V. Vertices that no face uses are kept.
    order : {"keep", "vertices", "drop"}
        What is preserved: everything as given; the vertex order, and the same oriented triangles
        in any order and rotation; or the mesh with its vertices renumbered.

    Raises
    ------
    InvalidInputError
        If `order` is none of these.
    """
    if order not in ORDERS:
        raise InvalidInputError(f"order must be one of {', '.join(ORDERS)}; got {order!r}")
    listed = _code_as_listed(np.ascontiguousarray(faces, dtype=np.int32), n_verts)
    traversed = _code_traversal(listed.internal_faces, n_verts, order)
    if traversed is None:
        return listed
    return min(listed, traversed, key=lambda coded: len(coded.payload) + len(coded.order_payload))


@staged("connectivity")
def decode_connectivity(payload: bytes, n_verts: int, n_faces: int) -> Faces:
    """The internal faces, int32 of shape (M, 3).

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
    if not payload:
        raise CorruptStreamError("the connectivity is empty")
    if payload[0] == AS_LISTED:
        return decode_face_list(payload[1:], n_verts, n_faces)
    if payload[0] not in CODING_OF_KIND:
        raise CorruptStreamError(f"connectivity of kind {payload[0]} is not known; 0..2 are")
    return decode_traversal(payload[1:], CODING_OF_KIND[payload[0]], n_verts, n_faces)


@staged("order")
def decode_order(
    order_payload: bytes, internal_faces: Faces, n_verts: int
) -> tuple[Integers, Faces]:
    """`internal_to_given`, and the faces in the given order.

    Parameters
    ----------
    order_payload : bytes
        From `encode_connectivity`; empty if only the internal order is known.
    internal_faces : int32 array of shape (M, 3)
        From `decode_connectivity`.
    n_verts : int

    Raises
    ------
    CorruptStreamError
        If the payload is damaged or belongs to another mesh.
    """
    if not order_payload:
        return np.arange(n_verts), internal_faces
    internal_to_given, faces = decode_given_order(order_payload, internal_faces, n_verts)
    return internal_to_given, faces.astype(np.int32)


def _code_as_listed(faces: Faces, n_verts: int) -> CodedConnectivity:
    payload = bytes([AS_LISTED]) + encode_face_list(faces, n_verts)
    return CodedConnectivity(payload, b"", np.arange(n_verts), faces)


def _code_traversal(faces: Faces, n_verts: int, order: str) -> CodedConnectivity | None:
    traversal = encode_traversal(faces, n_verts)
    if traversal is None:
        return None
    payload = bytes([KIND_OF_CODING[traversal.coding]]) + traversal.body
    internal, back = traversal.internal_faces, traversal.internal_to_given
    if order == "drop":
        return CodedConnectivity(payload, b"", back, internal)
    order_payload = encode_order(faces, internal, back, keep_faces=order == "keep")
    return CodedConnectivity(payload, order_payload, back, internal)
