"""Coding of the original order of faces and vertices of a known mesh, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.kernel.library import call, encoded, int32s

Integers = npt.NDArray[np.int32]
AnyIntegers = npt.NDArray[np.integer]

BYTES_EACH = 32
"""Upper bound of the bytes of a vertex or a face."""

MAX_FACES = 1 << 29


def opposite_sides(faces: AnyIntegers, n_verts: int) -> Integers:
    """The opposite side of each side of faces of shape (M, 3), or itself; int32 of shape (3 M,).

    Raises
    ------
    InvalidInputError
        If there are too many faces, or a face contains a vertex that does not exist.
    """
    n_faces = len(faces)
    _check_count(n_faces)
    twins = np.empty(3 * n_faces, np.int32)
    call(
        "reel_twins",
        int32s(faces),
        n_faces,
        n_verts,
        twins,
        what="faces",
        memory_of=("reel_twins_memory", n_verts, n_faces),
    )
    return twins


def encode_order(
    faces: AnyIntegers,
    twins: AnyIntegers | None,
    corners: AnyIntegers | None,
    sequence: AnyIntegers,
) -> bytes:
    """Encode the original order of vertices, and optionally of faces.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
        The mesh that the decoder knows.
    twins : integer array of shape (3 M,), or None
        The opposite side of each side ``3 i + k`` of face i, or itself: an involution.
    corners : integer array of shape (M,), or None
        ``3 i + k`` for each face in the original order: the i-th known face, from its corner k.
        None to encode only the order of vertices.
    sequence : integer array of shape (V,)
        Known vertices in the original order.

    Raises
    ------
    InvalidInputError
        If there are too many faces.
    """
    n_verts, n_faces = len(sequence), len(faces)
    _check_count(n_faces)
    return encoded(
        "reel_order_encode",
        int32s(faces),
        None if twins is None else int32s(twins),
        n_verts,
        n_faces,
        int(corners is not None),
        None if corners is None else int32s(corners).copy(),  # the core modifies copies
        int32s(sequence).copy(),
        what="orders",
        capacity=BYTES_EACH * (n_verts + n_faces + 1),
        memory_of=("reel_order_memory", n_verts, n_faces),
    )


def _check_count(n_faces: int) -> None:
    if n_faces > MAX_FACES:
        raise InvalidInputError(f"the order of at most {MAX_FACES} faces is kept; got {n_faces}")
