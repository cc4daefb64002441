"""Coding of fields, rows of small integers over the same columns, by the core.

Designed for residuals of modes at the vertices of a mesh, modes by descending energy. The
probabilities adapt to coded values on both sides, so no tables are stored.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import InvalidInputError
from meshreel.kernel.library import encoded

MAX_MAGNITUDE = (1 << 31) - 1
MAX_INTEGER_BYTES, MAX_OVERHEAD_BYTES = 16, 1 << 16
"""Bounds of the bytes of an integer, and of the extra bytes before probabilities have adapted."""


class CodingOrder(NamedTuple):
    """Coding order of the columns of a row, as in `core/reel.h`."""

    n_columns: int
    columns: npt.NDArray[np.int32]
    """int32 array of shape (n_columns,)."""
    pass_starts: Integers
    """int64 array of shape (n_passes + 1,)."""
    n_passes: int
    near_starts: Integers
    """int64 array of shape (n_columns + 1,)."""
    near: npt.NDArray[np.int32]
    """int32 array."""

    @property
    def memory_of(self) -> tuple[str, int, int, int]:
        """Argument `memory_of` of `call`: the function of the memory size, and its arguments."""
        return "reel_fields_memory", self.n_columns, self.n_passes, len(self.near)


def coding_order(near: npt.NDArray[np.integer], pass_starts: Integers) -> CodingOrder:
    """Return the coding order of columns in numerical order, for `encode_fields`.

    Parameters
    ----------
    near : integer array of shape (n_columns, n)
        Context neighbors of each coded column, at most 16, padded with -1; all are coded
        before it, in its pass or an earlier one.
    pass_starts : int64 array
        The first column of each pass, and the number of columns.
    """
    is_neighbor = near >= 0
    near_starts = np.zeros(len(near) + 1, np.int64)
    np.cumsum(is_neighbor.sum(axis=1), out=near_starts[1:])
    return CodingOrder(
        len(near),
        np.arange(len(near), dtype=np.int32),
        pass_starts,
        len(pass_starts) - 1,
        near_starts,
        near[is_neighbor].astype(np.int32),
    )


def encode_fields(fields: npt.NDArray[np.integer], passes: CodingOrder | None = None) -> bytes:
    """Encode rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to `MAX_MAGNITUDE`. Rows similar to previous rows take the fewest bytes.
    passes : CodingOrder, optional
        Coding order of each row, and the context neighbors of each column. Columns of a pass should
        have similar magnitudes. The decoder needs the same passes. Default: one pass.

    Raises
    ------
    InvalidInputError
        If an integer is too large, the array does not have two axes, or the passes do not contain
        each column once, after its neighbors.
    """
    array = np.asarray(fields)
    if array.ndim != 2 or max(array.max(initial=0), -int(array.min(initial=0))) > MAX_MAGNITUDE:
        raise InvalidInputError(
            f"fields must have shape (rows, columns) and magnitudes up to {MAX_MAGNITUDE}; "
            f"got shape {array.shape}; use fewer bits or a larger quantization step"
        )
    n_rows, n_columns = array.shape
    values = np.array(array, np.int32, order="C")  # a copy, because the core modifies it
    order = _checked(passes, n_columns)
    return encoded(
        "reel_fields_encode",
        values,
        n_rows,
        *order,
        noun="fields",
        capacity=MAX_INTEGER_BYTES * values.size + MAX_OVERHEAD_BYTES,
        memory_of=order.memory_of,
    )


def _checked(passes: CodingOrder | None, n_columns: int) -> CodingOrder:
    """Check the number of columns; None becomes a single pass without context neighbors."""
    if passes is None:
        return coding_order(np.empty((n_columns, 0), np.int32), np.array([0, n_columns]))
    if passes.n_columns != n_columns:
        raise InvalidInputError(
            f"the passes have {passes.n_columns} columns; the fields have {n_columns} columns"
        )
    return passes
