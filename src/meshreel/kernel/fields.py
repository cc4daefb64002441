"""Coding of fields, rows of small integers over the same columns, by the core.

Designed for residuals of modes at the vertices of a mesh, modes by descending energy. The
probabilities adapt to coded values on both sides, so no tables are stored.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call, memory, size_of

MAX_MAGNITUDE = (1 << 31) - 1
MAX_NEAR = 16
"""Maximum number of context neighbors of a column."""

BYTES_EACH, BYTES_AT_FIRST = 16, 1 << 16
"""Bounds of the bytes of an integer, and of the extra bytes before probabilities have adapted."""


@dataclass(frozen=True)
class Pass:
    """Columns that are coded sequentially, and their context neighbors.

    Attributes
    ----------
    columns : integer array of shape (n,)
        Every column is in exactly one pass of a row.
    indptr : integer array of shape (n + 1,)
    indices : integer array
        The context neighbors of columns[i] are indices[indptr[i] : indptr[i + 1]], at most
        `MAX_NEAR`, all coded before it, in this pass or an earlier one.
    """

    columns: npt.NDArray[np.integer]
    indptr: npt.NDArray[np.integer]
    indices: npt.NDArray[np.integer]


def single_pass(n_columns: int) -> list[Pass]:
    """One pass with all columns, without context neighbors."""
    no_neighbors = np.zeros(0, np.int64)
    return [Pass(np.arange(n_columns), np.zeros(n_columns + 1, np.int64), no_neighbors)]


class CodingOrder(NamedTuple):
    """Coding order of the columns of a row, as in `core/reel.h`.

    Attributes
    ----------
    columns : int32 array of shape (n_columns,)
    pass_starts : int64 array of shape (n_passes + 1,)
    near_starts : int64 array of shape (n_columns + 1,)
    near : int32 array
    """

    n_columns: int
    columns: npt.NDArray[np.int32]
    pass_starts: Integers
    n_passes: int
    near_starts: Integers
    near: npt.NDArray[np.int32]

    @property
    def memory(self) -> npt.NDArray[np.uint8]:
        """Working memory for the core."""
        return memory(size_of("reel_fields_memory", self.n_columns, self.n_passes, len(self.near)))


Passes = CodingOrder | Sequence[Pass]


def order_of(passes: Sequence[Pass], n_columns: int) -> CodingOrder:
    """The coding order of passes, for `encode_fields` and `decode_fields`.

    Raises
    ------
    InvalidInputError
        If the number of columns or neighbors does not match.
    """
    none = np.zeros(0, np.int64)
    columns = np.concatenate([none, *(part.columns for part in passes)])
    n_near = np.concatenate([none, *(np.diff(part.indptr) for part in passes)])
    near = np.concatenate([none, *(part.indices for part in passes)])
    if len(columns) != n_columns or len(n_near) != n_columns or n_near.sum() != len(near):
        raise InvalidInputError(
            f"the passes have {len(columns)} columns and {len(near)} context neighbors; the "
            f"fields have {n_columns} columns"
        )
    return CodingOrder(
        n_columns,
        columns.astype(np.int32),
        np.cumsum([0, *(len(part.columns) for part in passes)], dtype=np.int64),
        len(passes),
        np.concatenate([[0], np.cumsum(n_near)]).astype(np.int64),
        near.astype(np.int32),
    )


def order_of_rows(near: npt.NDArray[np.int32], pass_starts: Integers) -> CodingOrder:
    """The coding order of columns in numerical order.

    Parameters
    ----------
    near : int32 array of shape (n_columns, n)
        Context neighbors of each column, padded with -1.
    pass_starts : int64 array
        The first column of each pass, and the number of columns.
    """
    is_neighbor = near >= 0
    near_starts = np.zeros(len(near) + 1, np.int64)
    np.cumsum(is_neighbor.sum(axis=1), out=near_starts[1:])
    columns = np.arange(len(near), dtype=np.int32)
    n_passes = len(pass_starts) - 1
    return CodingOrder(len(near), columns, pass_starts, n_passes, near_starts, near[is_neighbor])


def encode_fields(fields: npt.NDArray[np.integer], passes: Passes | None = None) -> bytes:
    """Encode rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to `MAX_MAGNITUDE`. Rows similar to previous rows take the fewest bytes.
    passes : CodingOrder or sequence of Pass, optional
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
    out = np.empty(BYTES_EACH * values.size + BYTES_AT_FIRST, np.uint8)
    order = _coding_order(passes, n_columns)
    work = order.memory
    size = call(
        "reel_fields_encode",
        work,
        len(work),
        values,
        n_rows,
        *order,
        out,
        len(out),
        what="fields",
    )
    return out[:size].tobytes()


def decode_fields(
    data: bytes,
    n_rows: int,
    n_columns: int,
    passes: Passes | None = None,
    n_wanted: int | None = None,
) -> npt.NDArray[np.int32]:
    """Decode integers of shape (rows, columns) that `encode_fields` wrote with the same passes.

    Only the first `n_wanted` rows, if fewer. The caller must bound both counts: any number of zeros
    takes few bytes.

    Raises
    ------
    CorruptStreamError
        If bytes are missing or left over.
    """
    if data and not data[-1]:
        raise CorruptStreamError("the fields end before their section does")
    n_wanted = n_rows if n_wanted is None else min(n_wanted, n_rows)
    values = np.empty((n_wanted, n_columns), np.int32)
    order = _coding_order(passes, n_columns)
    work = order.memory
    call(
        "reel_fields_decode",
        work,
        len(work),
        data,
        len(data),
        n_rows,
        n_wanted,
        *order,
        values,
        what="fields",
    )
    return values


def _coding_order(passes: Passes | None, n_columns: int) -> CodingOrder:
    if not isinstance(passes, CodingOrder):
        return order_of(single_pass(n_columns) if passes is None else passes, n_columns)
    if passes.n_columns != n_columns:
        raise InvalidInputError(
            f"the passes have {passes.n_columns} columns; the fields have {n_columns} columns"
        )
    return passes
