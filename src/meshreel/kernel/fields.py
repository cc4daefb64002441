"""Fields to bytes and back, by the core: rows of small integers over the same columns.

Meant for residuals of modes at the vertices of a mesh, modes by falling energy. Both sides learn
what to expect from what is already coded, so that no tables are sent.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.library import call, memory, size_of
from meshreel.runtime.profiling import staged

MAX_MAGNITUDE = (1 << 31) - 1
MAX_NEAR = 16
"""Most context neighbours of a column."""

BYTES_EACH, BYTES_AT_FIRST = 16, 1 << 16
"""Room for the bytes of each integer, and for the surprises before anything is learned."""


@dataclass(frozen=True)
class Pass:
    """Columns that are coded one after another, and the context neighbours of each.

    Attributes
    ----------
    columns : integer array of shape (n,)
        Every column is in exactly one pass of a row.
    indptr : integer array of shape (n + 1,)
    indices : integer array
        The context neighbours of columns[i] are indices[indptr[i] : indptr[i + 1]], at most
        `MAX_NEAR`. All come before it, in this pass or in an earlier one.
    """

    columns: npt.NDArray[np.integer]
    indptr: npt.NDArray[np.integer]
    indices: npt.NDArray[np.integer]


def single_pass(n_columns: int) -> list[Pass]:
    """The pass that holds all columns, without context neighbours."""
    nothing = np.zeros(0, np.int64)
    return [Pass(np.arange(n_columns), np.zeros(n_columns + 1, np.int64), nothing)]


class CodingOrder(NamedTuple):
    """In which order the columns of a row are coded, as the core takes it; see `core/reel.h`.

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
        """Memory that the core needs."""
        return memory(size_of("reel_fields_memory", self.n_columns, self.n_passes, len(self.near)))


Passes = CodingOrder | Sequence[Pass]


def order_of(passes: Sequence[Pass], n_columns: int) -> CodingOrder:
    """The order that passes say, for `encode_fields` and `decode_fields`.

    Raises
    ------
    InvalidInputError
        If they are of another number of columns, or of neighbours.
    """
    none = np.zeros(0, np.int64)
    columns = np.concatenate([none, *(one.columns for one in passes)])
    n_near = np.concatenate([none, *(np.diff(one.indptr) for one in passes)])
    near = np.concatenate([none, *(one.indices for one in passes)])
    if len(columns) != n_columns or len(n_near) != n_columns or n_near.sum() != len(near):
        raise InvalidInputError(
            f"the passes have {len(columns)} columns and {len(near)} context neighbours; the "
            f"fields have {n_columns} columns"
        )
    return CodingOrder(
        n_columns,
        columns.astype(np.int32),
        np.cumsum([0, *(len(one.columns) for one in passes)], dtype=np.int64),
        len(passes),
        np.concatenate([[0], np.cumsum(n_near)]).astype(np.int64),
        near.astype(np.int32),
    )


def order_of_rows(near: npt.NDArray[np.int32], pass_starts: Integers) -> CodingOrder:
    """The order of columns as they are numbered.

    Parameters
    ----------
    near : int32 array of shape (n_columns, n)
        Context neighbours of each column; -1 behind the last.
    pass_starts : int64 array
        The first column of each pass, and the number of columns.
    """
    is_there = near >= 0
    near_starts = np.zeros(len(near) + 1, np.int64)
    np.cumsum(is_there.sum(axis=1), out=near_starts[1:])
    columns = np.arange(len(near), dtype=np.int32)
    n_passes = len(pass_starts) - 1
    return CodingOrder(len(near), columns, pass_starts, n_passes, near_starts, near[is_there])


def encode_fields(fields: npt.NDArray[np.integer], passes: Passes | None = None) -> bytes:
    """Bytes of rows of integers over the same columns.

    Parameters
    ----------
    fields : integer array of shape (rows, columns)
        Magnitudes up to `MAX_MAGNITUDE`. Rows that resemble those before take the fewest bytes.
    passes : CodingOrder or sequence of Pass, optional
        The order in which each row is coded, and the context neighbours of each column. Columns of
        a pass should be alike in magnitude. The reader needs the same passes. Default: all columns
        in one.

    Raises
    ------
    InvalidInputError
        If an integer is too large, or the array does not have two axes, or the passes do not hold
        each column once with neighbours that come before it.
    """
    found = np.asarray(fields)
    if found.ndim != 2 or max(found.max(initial=0), -int(found.min(initial=0))) > MAX_MAGNITUDE:
        raise InvalidInputError(
            f"fields must have shape (rows, columns) and magnitudes up to {MAX_MAGNITUDE}; "
            f"got shape {found.shape}; use fewer bits or a larger quantisation step"
        )
    n_rows, n_columns = found.shape
    values = np.array(found, np.int32, order="C")  # a copy: the core writes what it codes
    out = np.empty(BYTES_EACH * values.size + BYTES_AT_FIRST, np.uint8)
    order = _checked(passes, n_columns)
    room = order.memory
    size = call(
        "reel_fields_encode",
        room,
        len(room),
        values,
        n_rows,
        *order,
        out,
        len(out),
        what="fields",
    )
    return out[:size].tobytes()


@staged("entropy coding")
def decode_fields(
    data: bytes,
    n_rows: int,
    n_columns: int,
    passes: Passes | None = None,
    n_wanted: int | None = None,
) -> npt.NDArray[np.int32]:
    """Integers of shape (rows, columns) that `encode_fields` wrote, given the same passes.

    Only the first `n_wanted` rows, where these are fewer. The caller bounds both counts: any number
    of zeros takes few bytes.

    Raises
    ------
    CorruptStreamError
        If some bytes are left over.
    """
    if data and not data[-1]:
        raise CorruptStreamError("the fields end before their section does")
    n_wanted = n_rows if n_wanted is None else min(n_wanted, n_rows)
    values = np.empty((n_wanted, n_columns), np.int32)
    order = _checked(passes, n_columns)
    room = order.memory
    call(
        "reel_fields_decode",
        room,
        len(room),
        data,
        len(data),
        n_rows,
        n_wanted,
        *order,
        values,
        what="fields",
    )
    return values


def _checked(passes: Passes | None, n_columns: int) -> CodingOrder:
    if not isinstance(passes, CodingOrder):
        return order_of(single_pass(n_columns) if passes is None else passes, n_columns)
    if passes.n_columns != n_columns:
        raise InvalidInputError(
            f"the passes have {passes.n_columns} columns; the fields have {n_columns} columns"
        )
    return passes
