"""Per-frame sums from which the errors of a sequence are computed.

Large frames do not fit into the cache; chunks of vertices do, and several cores share them.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import product

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.reference import Reference
from meshreel.model.sequence import Vertices
from meshreel.runtime.threads import chunks, in_threads

VERTS_PER_CHUNK = 1 << 15
"""Fits into the cache, and keeps threads from contending for the interpreter's lock."""

MIN_VERTS_PER_TASK = 1 << 17
"""Minimum number of vertices, of one frame or several, per task of a thread."""


@dataclass(frozen=True, eq=False)
class FrameSums:
    """Sums over a set of vertices of one frame, in scaled units."""

    n_verts: int
    error: float
    largest: float
    """Sum and maximum of the squared displacements."""
    spread: float
    """Sum of the squared distances from the mean."""
    mean: Floats
    """float64 array of shape (3,). Relative to the first vertex of the frame."""


def sums_of_frames(original: Vertices, decoded: Vertices, reference: Reference) -> list[FrameSums]:
    """Sums of each frame, independent of the number of cores.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), V at least 1
    reference : Reference
        Of the whole original sequence.

    Source: chunks are merged as in Chan, Golub and LeVeque, "Updating formulae and a pairwise
    algorithm for computing sample variances", 1979.
    """
    n_frames, n_verts = original.shape[:2]
    with np.errstate(over="ignore", invalid="ignore"):
        first_positions = reference.apply(original[:, 0])
    pieces = chunks(n_verts, VERTS_PER_CHUNK)
    parts = list(product(range(n_frames), pieces))
    tasks = chunks(len(parts), max(1, MIN_VERTS_PER_TASK // min(n_verts, VERTS_PER_CHUNK)))
    sums: list[FrameSums] = [_NO_VERTS] * len(parts)

    def run(task: slice) -> None:
        for number in range(task.start, task.stop):
            frame, piece = parts[number]
            pair = original[frame, piece], decoded[frame, piece]
            sums[number] = _sums_of_part(*pair, reference, first_positions[frame])

    with np.errstate(over="ignore", invalid="ignore"):
        if len(tasks) == 1:
            run(tasks[0])
        else:
            in_threads(run, tasks)
        return [reduce(_merge, sums[frame]) for frame in chunks(len(parts), len(pieces))]


_NO_VERTS = FrameSums(0, 0.0, 0.0, 0.0, np.zeros(3))


def _sums_of_part(
    original: Vertices, decoded: Vertices, reference: Reference, first: Floats
) -> FrameSums:
    # One row per axis: NumPy takes four times as long on rows of three numbers.
    positions = original.T.astype(np.float64, order="C")
    displacements = decoded.T.astype(np.float64, order="C")
    displacements -= positions  # before the center is removed, as in `paired_frames`
    displacements *= reference.scale
    displacements *= displacements
    squares = displacements.sum(axis=0)
    positions -= reference.center[:, np.newaxis]
    positions *= reference.scale
    positions -= first[:, np.newaxis]  # so that coincident vertices give exact zeros
    mean = positions.mean(axis=1)
    positions -= mean[:, np.newaxis]
    error, largest = float(squares.sum()), float(squares.max())
    return FrameSums(len(original), error, largest, sum_of_squares(positions), mean)


def sum_of_squares(vectors: Floats) -> float:
    """Sum of the squares of an array of shape (N, A)."""
    # Not by BLAS, whose threads cost more than they save on one frame.
    return float(np.einsum("na,na->", vectors, vectors))


def _merge(first: FrameSums, second: FrameSums) -> FrameSums:
    n_verts = first.n_verts + second.n_verts
    offset = second.mean - first.mean
    share = second.n_verts / n_verts
    between = float(offset @ offset) * first.n_verts * share
    return FrameSums(
        n_verts,
        first.error + second.error,
        max(first.largest, second.largest),
        first.spread + second.spread + between,
        first.mean + share * offset,
    )
