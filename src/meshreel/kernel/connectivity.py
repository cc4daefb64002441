"""Coding of face lists, by the core."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel.library import encoded, int32s

Faces = npt.NDArray[np.int32]

MAX_FACE_BYTES = 96
MAX_OVERHEAD_BYTES = 1024


class EncodedFaces(NamedTuple):
    """A face list in internal order."""

    data: bytes
    internal_to_given: Integers
    """int64 array of shape (V,). Input vertex of each internal one."""
    faces: Faces
    """int32 array of shape (M, 3). As the decoder restores them."""
    twins: npt.NDArray[np.int32]
    """int32 array of shape (3 M,). The other side at the edge of each internal side, or the side
    itself.
    """


def encode_faces(faces: Faces, n_verts: int, *, listed: bool) -> EncodedFaces:
    """Encode a face list.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    listed : bool
        Whether to keep the input order of faces and vertices; otherwise they have the order of
        a traversal of the surface, which takes fewer bytes.

    Raises
    ------
    InvalidInputError
        If a vertex does not exist, or there are more than 2^26 vertices or faces.
    """
    faces = int32s(faces)
    internal_faces = np.empty_like(faces)
    twins = np.empty(3 * len(faces), np.int32)
    internal_to_given = np.empty(n_verts, np.int32)
    data = encoded(
        "reel_connectivity_encode",
        faces,
        len(faces),
        n_verts,
        int(listed),
        internal_faces,
        twins,
        internal_to_given,
        noun="faces",
        capacity=MAX_FACE_BYTES * len(faces) + MAX_OVERHEAD_BYTES,
        memory_of=("reel_connectivity_encode_memory", n_verts, len(faces)),
    )
    return EncodedFaces(data, internal_to_given.astype(np.int64), internal_faces, twins)
