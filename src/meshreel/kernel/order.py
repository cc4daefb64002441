"""Coding of the original order of faces and vertices of a known mesh, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.kernel.library import call, encoded, int32s

Integers = npt.NDArray[np.int32]
AnyIntegers = npt.NDArray[np.integer]

MAX_ITEM_BYTES = 32
"""Upper bound of the bytes of a vertex, a face or a cell."""

MAX_FACES = 1 << 29


def opposite_sides(faces: AnyIntegers, n_verts: int) -> Integers:
    """The opposite side of each side of faces of shape (M, 3), or itself; int32 of shape (3 M,).

    More than two sides on one edge are paired in order, regardless of their direction.

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
        noun="faces",
        memory_of=("reel_twins_memory", n_verts, n_faces),
    )
    return twins


def depth_first_order(faces: AnyIntegers) -> npt.NDArray[np.int64]:
    """The order in which a depth-first walk across shared edges reaches faces, of shape (M,).

    Raises
    ------
    InvalidInputError
        If there are too many faces.
    """
    twins = opposite_sides(faces, int(faces.max(initial=0)) + 1).tolist()
    is_visited = bytearray(len(faces))
    order = []
    for start in range(0, len(twins), 3):
        sides = [start]
        while sides:
            face, corner = divmod(sides.pop(), 3)
            if not is_visited[face]:
                is_visited[face] = True
                order.append(face)
                sides += [twins[3 * face + (corner + step) % 3] for step in (1, 2)]
    return np.array(order, np.int64)


def number_by_use(faces: AnyIntegers) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Vertices in the order in which faces of shape (M, 3) use them, and the number of each."""
    verts, first = np.unique(faces.astype(np.int64), return_index=True)
    by_use = verts[np.argsort(first)]
    numbers = np.full(int(faces.max(initial=-1)) + 1, -1, np.int64)
    numbers[by_use] = np.arange(len(by_use))
    return by_use, numbers


def encode_order(faces: AnyIntegers, corners: AnyIntegers | None, sequence: AnyIntegers) -> bytes:
    """Encode the original order of vertices, and optionally of faces.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
        The mesh that the decoder knows.
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
    twins = None if corners is None else opposite_sides(faces, n_verts)
    return encoded(
        "reel_order_encode",
        int32s(faces),
        twins,
        n_verts,
        n_faces,
        int(corners is not None),
        None if corners is None else int32s(corners).copy(),  # the core modifies copies
        int32s(sequence).copy(),
        noun="orders",
        capacity=MAX_ITEM_BYTES * (n_verts + n_faces + 1),
        memory_of=("reel_order_memory", n_verts, n_faces),
    )


def _check_count(n_faces: int) -> None:
    if n_faces > MAX_FACES:
        raise InvalidInputError(f"an order may have at most {MAX_FACES} faces; got {n_faces}")
