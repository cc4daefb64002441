"""Face lists to bytes and back, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import CorruptStreamError
from meshreel.kernel.library import call

Faces = npt.NDArray[np.int32]

MOST_ITEMS = 1 << 26
"""Most vertices, and most faces, of a mesh."""

BYTES_EACH = 96
MORE_BYTES = 1024


def encode_faces(faces: Faces, n_verts: int, *, listed: bool) -> tuple[bytes, Integers, Faces]:
    """Bytes of a face list, the given number of each internal vertex, and the internal faces.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    listed : bool
        Whether internal faces and vertices are the given ones in their given order; otherwise
        they are in the order of a walk over the surface, which takes fewer bytes.

    Raises
    ------
    InvalidInputError
        If a corner is no vertex, or there are more than `MOST_ITEMS`.
    """
    faces = np.ascontiguousarray(faces, np.int32)
    internal_faces = np.empty_like(faces)
    internal_to_given = np.empty(n_verts, np.int32)
    out = np.empty(BYTES_EACH * len(faces) + MORE_BYTES, np.uint8)
    size = call(
        "reel_connectivity_encode",
        faces,
        len(faces),
        n_verts,
        int(listed),
        internal_faces,
        internal_to_given,
        out,
        len(out),
        what="faces",
        memory_of=("reel_connectivity_encode_memory", n_verts, len(faces)),
    )
    return out[:size].tobytes(), internal_to_given.astype(np.int64), internal_faces


def decode_faces(data: bytes, n_verts: int, n_faces: int) -> Faces:
    """The internal faces, of shape (M, 3), that `encode_faces` wrote.

    The caller bounds both counts.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of so many faces on so many vertices.
    """
    if max(n_verts, n_faces) > MOST_ITEMS:
        raise CorruptStreamError(f"a mesh has at most {MOST_ITEMS} vertices and faces")
    faces = np.empty((n_faces, 3), np.int32)
    call(
        "reel_connectivity_decode",
        data,
        len(data),
        n_verts,
        n_faces,
        faces,
        what="faces",
        memory_of=("reel_connectivity_decode_memory", n_verts, n_faces),
    )
    return faces
