"""Codes of the table rows that corners of faces refer to, by the core."""

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call, int32s

AnyIntegers = npt.NDArray[np.integer]
Integers = npt.NDArray[np.int32]

N_CONTEXTS = 9
"""REEL_CORNER_CONTEXTS of `core/reel.h`."""


def corner_codes(
    faces: AnyIntegers,
    twins: AnyIntegers,
    items: AnyIntegers | None,
    rows: AnyIntegers,
    n_verts: int,
) -> tuple[Integers, npt.NDArray[np.uint8], Integers]:
    """Return the number, the context and the code of each item, in coding order.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    twins : integer array of shape (3 M,)
        The opposite side of each side, or itself, as `opposite_sides` returns it.
    items : integer array of shape (M, 3), or None
        The item at each corner of a triangle: the corner of its polygon. None: the corner itself.
    rows : integer array of shape (N,)
        The row of each item; at least 0.

    Raises
    ------
    InvalidInputError
        If a row is negative.
    """
    n_items = len(rows)
    order, codes = np.empty(n_items, np.int32), np.empty(n_items, np.int32)
    contexts = np.empty(n_items, np.uint8)
    call(
        "reel_corner_codes",
        int32s(faces),
        int32s(twins),
        None if items is None else int32s(items),
        len(faces),
        n_verts,
        n_items,
        int32s(rows),
        order,
        contexts,
        codes,
        noun="rows of corners",
        memory_of=("reel_corner_rows_memory", n_verts, n_items),
    )
    return order, contexts, codes
