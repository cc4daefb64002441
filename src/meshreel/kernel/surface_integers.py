"""Coding of integers on a surface, by the core."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import encoded, int32s

Integers = npt.NDArray[np.integer[Any]]
Table = npt.NDArray[np.int32]

MAX_VALUE_BYTES, MAX_OVERHEAD_BYTES = 10, 64
MAX_VALUE, MAX_COLUMNS = 1 << 29, 16
"""REEL_MAX_SURFACE_VALUE and REEL_MAX_SURFACE_COLUMNS of `core/reel.h`."""


def encode_on_surface(values: Table, faces: Integers, twins: Integers) -> bytes:
    """Encode frames of a table of int32, whose rows are the vertices of triangles.

    Parameters
    ----------
    values : int32 array of shape (T, N, C)
        Up to `MAX_VALUE` in magnitude, at most `MAX_COLUMNS` columns.
    faces : integer array of shape (M, 3)
        Rows, in 0..N-1.
    twins : integer array of shape (3 M,)
        As in `patterns.face_predictors`, or those of `connectivity.encode_faces`.

    Raises
    ------
    InvalidInputError
        If a value is too large.
    """
    n_frames, n_rows, n_columns = values.shape
    return encoded(
        "reel_surface_integers_encode",
        int32s(values),
        n_frames,
        n_rows,
        n_columns,
        int32s(faces),
        int32s(twins),
        len(faces),
        noun="integers on a surface",
        capacity=MAX_VALUE_BYTES * values.size + MAX_OVERHEAD_BYTES,
        memory_of=("reel_surface_integers_memory", n_frames, n_rows, n_columns, len(faces), True),
    )
