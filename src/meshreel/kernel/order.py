"""Coding of the original order of faces and vertices of a known mesh, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.kernel.library import call

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
        _contiguous(faces),
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
    out = np.empty(BYTES_EACH * (n_verts + n_faces + 1), np.uint8)
    size = call(
        "reel_order_encode",
        _contiguous(faces),
        None if twins is None else _contiguous(twins),
        n_verts,
        n_faces,
        int(corners is not None),
        None if corners is None else _contiguous(corners).copy(),  # the core modifies copies
        _contiguous(sequence).copy(),
        out,
        len(out),
        what="orders",
        memory_of=("reel_order_memory", n_verts, n_faces),
    )
    return out[:size].tobytes()


def _contiguous(values: AnyIntegers) -> Integers:
    return np.ascontiguousarray(values, np.int32)


def _check_count(n_faces: int) -> None:
    if n_faces > MAX_FACES:
        raise InvalidInputError(f"the order of at most {MAX_FACES} faces is kept; got {n_faces}")
