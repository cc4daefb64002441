"""Lossless coding of tables of numbers, by the core."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.kernel.library import call, encoded, int32s
from meshreel.kernel.predict import kriging_weights

Numbers = npt.NDArray[Any]

STENCIL_SIZE, NUGGET = 16, 0.125
"""Maximum number of rows in a stencil; variance of the noise for weights from points."""

MAX_NUMBER_BYTES, MAX_ROW_BYTES = 24, 32
"""Upper bounds of the bytes of a number, and of the overhead of a row."""


@dataclass(frozen=True)
class Predictors:
    """Coding order and predictors of the rows of a table."""

    order: npt.NDArray[np.int32]
    """int32 array of shape (N,). A permutation of 0..N-1."""
    starts: npt.NDArray[np.int64]
    """int64 array of shape (N + 1,)."""
    triples: npt.NDArray[np.int32]
    """int32 array of shape (*, 3). The prediction of row ``order[i]`` is the mean of ``a + b - c``
    over the triples ``starts[i]:starts[i + 1]``, or row ``a`` if c is -1. All are rows coded before
    it.
    """
    stencils: npt.NDArray[np.int32] | None = None
    """int32 array of shape (N, S). Rows that instead predict each row, padded with -1."""
    weights: npt.NDArray[np.float32] | None = None
    """float32 array of shape (N, S). Their weights."""


def no_predictors(n_rows: int) -> Predictors:
    """Rows in order, without predictions."""
    return Predictors(_in_order(n_rows), np.zeros(n_rows + 1, np.int64), np.zeros((0, 3), np.int32))


def previous_predictors(n_rows: int) -> Predictors:
    """Rows in order, each predicted to equal the previous one."""
    previous = np.arange(max(n_rows - 1, 0), dtype=np.int32)
    triples = np.stack([previous, previous, np.full_like(previous, -1)], axis=1)
    starts = np.maximum(np.arange(-1, n_rows, dtype=np.int64), 0)
    return Predictors(_in_order(n_rows), starts, triples)


def linear_predictors(n_rows: int) -> Predictors:
    """Rows in order, each predicted linearly from the previous two; the second, from the first."""
    predictors = previous_predictors(n_rows)
    predictors.triples[1:, 2] = predictors.triples[:-1, 0]
    return predictors


def _in_order(n_rows: int) -> npt.NDArray[np.int32]:
    return np.arange(n_rows, dtype=np.int32)


def face_predictors(
    faces: Numbers, twins: Numbers, n_rows: int, points: Numbers | None = None
) -> Predictors:
    """Find the predictors of the rows of a table, which are adjacent as in faces.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
        Rows, in 0..N-1.
    twins : integer array of shape (3 M,)
        The opposite side of each side ``3 i + k`` of face i, or itself: an involution.
    n_rows : int
        N.
    points : float64 array of shape (N, 3), optional
        Positions of the rows, from which weights of stencils follow.
    """
    stencils = None if points is None else np.empty((n_rows, STENCIL_SIZE), np.int32)
    order = np.empty(n_rows, np.int32)
    starts = np.empty(n_rows + 1, np.int64)
    triples = np.empty((3 * len(faces) + n_rows, 3), np.int32)
    n_triples = call(
        "reel_predictors_find",
        int32s(faces),
        int32s(twins),
        n_rows,
        len(faces),
        order,
        starts,
        triples,
        stencils,
        noun="rows",
        memory_of=("reel_predictors_memory", n_rows, len(faces)),
    )
    weights = None
    if stencils is not None and points is not None:
        weights = kriging_weights(stencils, points, NUGGET)
    return Predictors(order, starts, triples[:n_triples].copy(), stencils, weights)


def encode_patterns(values: Numbers, predictors: Predictors) -> bytes:
    """Encode a table of shape (N, C) of uint8, int32, float32 or float64."""
    table = np.array(values, order="C")
    n_rows, width = table.shape
    return encoded(
        "reel_patterns_encode",
        table,
        *table.shape,
        table.dtype.itemsize,
        int(table.dtype.kind == "f"),
        predictors.order,
        predictors.starts,
        predictors.triples,
        predictors.stencils,
        predictors.weights,
        noun="numbers",
        capacity=MAX_NUMBER_BYTES * table.size + MAX_ROW_BYTES * (n_rows + 1),
        memory_of=("reel_patterns_memory", width),
    )


def decode_patterns(
    data: bytes, shape: tuple[int, int], dtype: np.dtype[Any], predictors: Predictors
) -> Numbers:
    """Decode a table that `encode_patterns` wrote; the caller must bound the shape.

    Raises
    ------
    CorruptStreamError
        If bytes are left over.
    """
    table = np.zeros(shape, dtype)
    call(
        "reel_patterns_decode",
        data,
        table,
        *shape,
        dtype.itemsize,
        int(dtype.kind == "f"),
        predictors.order,
        predictors.starts,
        predictors.triples,
        predictors.stencils,
        predictors.weights,
        noun="numbers",
        memory_of=("reel_patterns_memory", shape[1]),
    )
    return table
