"""What frames add to the errors of a sequence: sums over vertices, some of them at a time.

Whole frames of large meshes do not fit into the cache: to take some thousand vertices after others
takes a fraction of the time, and several cores share them.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import product

import numpy as np

from meshreel.arrays import Floats
from meshreel.metrics.reference import Reference
from meshreel.model.sequence import Vertices
from meshreel.runtime.threads import chunks, in_threads

VERTICES_AT_ONCE = 1 << 15
"""Vertices whose arrays stay in the cache; fewer make threads wait for the interpreter."""

LEAST_TOGETHER = 1 << 17
"""Vertices, of one frame or several, that are worth a thread."""


@dataclass(frozen=True, eq=False)
class FrameSums:
    """Sums of some vertices of a frame, in scaled units.

    Attributes
    ----------
    error, largest : float
        Sum of their squared displacements, and the largest.
    spread : float
        Sum of their squared distances from their mean.
    mean : float64 array of shape (3,)
        About the first vertex of the frame.
    """

    n_verts: int
    error: float
    largest: float
    spread: float
    mean: Floats


def sums_of_frames(original: Vertices, decoded: Vertices, reference: Reference) -> list[FrameSums]:
    """The sums of each frame, the same whatever the number of cores.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), V at least 1
    reference : Reference
        Of the whole original sequence.

    Source: parts are joined as by Chan, Golub and LeVeque, "Updating formulae and a pairwise
    algorithm for computing sample variances", 1979.
    """
    n_frames, n_verts = original.shape[:2]
    with np.errstate(over="ignore", invalid="ignore"):
        firsts = reference.apply(original[:, 0])
    pieces = chunks(n_verts, VERTICES_AT_ONCE)
    n_parts = n_frames * len(pieces)
    runs = chunks(n_parts, max(1, LEAST_TOGETHER // min(n_verts, VERTICES_AT_ONCE)))
    parts_of_frames = chunks(n_parts, len(pieces))
    parts = list(product(range(n_frames), pieces))
    found: list[FrameSums] = [_NOTHING] * len(parts)

    def add(run: slice) -> None:
        for number in range(run.start, run.stop):
            frame, piece = parts[number]
            pair = original[frame, piece], decoded[frame, piece]
            found[number] = _sums_of_part(*pair, reference, firsts[frame])

    with np.errstate(over="ignore", invalid="ignore"):
        if len(runs) == 1:
            add(runs[0])
        else:
            in_threads(add, runs)
        return [reduce(_joined, found[one]) for one in parts_of_frames]


_NOTHING = FrameSums(0, 0.0, 0.0, 0.0, np.zeros(3))


def _sums_of_part(
    original: Vertices, decoded: Vertices, reference: Reference, first: Floats
) -> FrameSums:
    # An axis after the other: arrays of three numbers a row take NumPy four times as long.
    places = original.T.astype(np.float64, order="C")
    moved = decoded.T.astype(np.float64, order="C")
    moved -= places  # before the centre is removed, as in `paired_frames`
    moved *= reference.scale
    moved *= moved
    squares = moved.sum(axis=0)
    places -= reference.centre[:, np.newaxis]
    places *= reference.scale
    places -= first[:, np.newaxis]  # so that coincident vertices give exact zeros
    mean = places.mean(axis=1)
    places -= mean[:, np.newaxis]
    error, largest = float(squares.sum()), float(squares.max())
    return FrameSums(len(original), error, largest, sum_of_squares(places), mean)


def sum_of_squares(vectors: Floats) -> float:
    """Sum of the squares of an array of shape (N, A).

    Not by BLAS, whose threads cost more than they save on one frame.
    """
    return float(np.einsum("na,na->", vectors, vectors))


def _joined(one: FrameSums, other: FrameSums) -> FrameSums:
    n_verts = one.n_verts + other.n_verts
    apart = other.mean - one.mean
    share = other.n_verts / n_verts
    between = float(apart @ apart) * one.n_verts * share
    return FrameSums(
        n_verts,
        one.error + other.error,
        max(one.largest, other.largest),
        one.spread + other.spread + between,
        one.mean + share * apart,
    )
