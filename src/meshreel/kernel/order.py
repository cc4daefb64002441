"""The given order of faces and vertices of a known mesh to bytes and back, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.kernel.library import call

Integers = npt.NDArray[np.int32]
AnyIntegers = npt.NDArray[np.integer]

BYTES_EACH = 32
"""Most bytes that a vertex or a face takes."""

MOST_FACES = 1 << 29


def opposite_sides(faces: AnyIntegers, n_verts: int) -> Integers:
    """The opposite side of each side of faces of shape (M, 3), or itself; int32 of shape (3 M,).

    Raises
    ------
    InvalidInputError
        If there are too many faces, or one names a vertex that is not there.
    """
    n_faces = len(faces)
    _require_few(n_faces)
    given, twins = _passed(faces), np.empty(3 * n_faces, np.int32)
    call(
        "reel_twins",
        given,
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
    """Bytes of the order in which vertices, and if asked for faces, were given.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
        The mesh that the reader knows.
    twins : integer array of shape (3 M,), or None
        The opposite side of each side ``3 i + k`` of face i, or itself: an involution.
    corners : integer array of shape (M,), or None
        ``3 i + k`` of each face in the given order: the i-th known face, from its corner k. None
        if only the order of vertices is kept.
    sequence : integer array of shape (V,)
        Known vertices in the given order.

    Raises
    ------
    InvalidInputError
        If there are too many faces.
    """
    n_verts, n_faces = len(sequence), len(faces)
    _require_few(n_faces)
    out = np.empty(BYTES_EACH * (n_verts + n_faces + 1), np.uint8)
    given = _passed(faces), None if twins is None else _passed(twins)
    # Copies: the core changes them.
    orders = None if corners is None else _passed(corners).copy(), _passed(sequence).copy()
    size = call(
        "reel_order_encode",
        *given,
        n_verts,
        n_faces,
        int(corners is not None),
        *orders,
        out,
        len(out),
        what="orders",
        memory_of=("reel_order_memory", n_verts, n_faces),
    )
    return out[:size].tobytes()


def decode_order(
    data: bytes, faces: AnyIntegers, twins: AnyIntegers | None, n_verts: int
) -> tuple[Integers | None, Integers]:
    """First corners and vertices in the given order, as `encode_order` was given them.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an order of this mesh.
    """
    n_faces = len(faces)
    _require_few(n_faces)
    corners = None if twins is None else np.zeros(n_faces, np.int32)
    sequence = np.zeros(n_verts, np.int32)
    call(
        "reel_order_decode",
        data,
        len(data),
        _passed(faces),
        None if twins is None else _passed(twins),
        n_verts,
        n_faces,
        int(corners is not None),
        corners,
        sequence,
        what="orders",
        memory_of=("reel_order_memory", n_verts, n_faces),
    )
    return corners, sequence


def _passed(values: AnyIntegers) -> Integers:
    return np.ascontiguousarray(values, np.int32)


def _require_few(n_faces: int) -> None:
    if n_faces > MOST_FACES:
        raise InvalidInputError(f"{n_faces} faces; the order of up to {MOST_FACES} can be kept")
