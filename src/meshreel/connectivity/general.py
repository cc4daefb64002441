"""Lossless coder of any face list: differences of neighbouring entries, entropy coded."""

import numpy as np
import numpy.typing as npt

from meshreel.counting import counted
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError
from meshreel.sequence import Faces

Integers = npt.NDArray[np.int64]

N_ROWS = 3


def face_differences(faces: npt.NDArray[np.integer]) -> list[Integers]:
    """Three rows of M integers: first corner less that of the face before, b - a, c - a."""
    a, b, c = np.asarray(faces, np.int64).T
    return [np.diff(a, prepend=0), b - a, c - a]


def join_differences(rows: list[Integers], n_verts: int) -> Faces:
    """The faces whose differences `face_differences` returned.

    Raises
    ------
    CorruptStreamError
        If a corner is not a vertex in 0..n_verts-1.
    """
    a = np.cumsum(rows[0])
    faces = np.stack([a, a + rows[1], a + rows[2]], axis=1)
    if faces.size and (faces.min() < 0 or faces.max() >= n_verts):
        raise CorruptStreamError(f"a face names a vertex outside 0..{n_verts - 1}")
    return faces.astype(np.int32)


def encode_face_list(faces: Faces, n_verts: int) -> bytes:
    """Bytes of the exact face list, including order and first corners."""
    counts = write_varint(n_verts) + write_varint(len(faces))
    return counts + encode_integers(face_differences(faces))


def decode_face_list(data: bytes, n_verts: int, n_faces: int) -> Faces:
    """The faces that `encode_face_list` wrote.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of a list of `n_faces` faces on `n_verts` vertices.
    """
    found_verts, position = read_varint(data, 0)
    found_faces, position = read_varint(data, position)
    if (found_verts, found_faces) != (n_verts, n_faces):
        raise CorruptStreamError(
            f"the list has {counted(found_faces, 'face')} on {counted(found_verts, 'vertex')}; "
            f"{n_faces} on {n_verts} are announced"
        )
    return join_differences(decode_integers(data[position:], [n_faces] * N_ROWS), n_verts)
