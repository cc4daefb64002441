"""The tree along which a sparse matrix is factored: what is eliminated together, and when."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array

Integers = npt.NDArray[np.int64]

SHARED_DEPTH = 5
"""What is below nodes of this depth is factored as one piece of work."""


@dataclass(frozen=True)
class Front:
    """Unknowns that are eliminated together, in the order of elimination.

    Attributes
    ----------
    start, stop : int
        They are start..stop-1.
    rows : integer array of shape (B,)
        Those behind them that eliminating them changes, ascending.
    children : list of int
        Fronts that change this one first, and all others through it.
    """

    start: int
    stop: int
    rows: Integers
    children: list[int]

    @property
    def n_entries(self) -> int:
        """Numbers that are kept of it."""
        size = self.stop - self.start
        return size * (size + len(self.rows))


@dataclass(frozen=True)
class Elimination:
    """An order of the unknowns, made of nodes that are eliminated one after another.

    Attributes
    ----------
    order : integer array of shape (V,)
        Which unknown comes when.
    nodes : integer array of shape (N,)
        Numbers of the nodes in the tree of `nested_dissection`, children before parents.
    ends : integer array of shape (N,)
        Where each ends in the order.
    """

    order: Integers
    nodes: Integers
    ends: Integers

    def waves(self) -> list[list[range]]:
        """Pieces of work, each a range of fronts; those of a wave need none of the same wave."""
        depths = _depths(self.nodes)
        owners = self.nodes >> np.maximum(depths - SHARED_DEPTH, 0)
        firsts = np.flatnonzero(np.diff(owners, prepend=-1))
        lasts = np.append(firsts[1:], len(owners))
        waves: list[list[range]] = [[] for _ in range(SHARED_DEPTH + 1)]
        for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
            waves[min(int(depths[last - 1]), SHARED_DEPTH)].append(range(first, last))
        return [wave for wave in waves[::-1] if wave]


def elimination_of(nodes: Integers) -> Elimination:
    """Subtree after subtree, children before parents.

    Parameters
    ----------
    nodes : integer array of shape (V,)
        From `nested_dissection`.
    """
    present, which, sizes = np.unique(nodes, return_inverse=True, return_counts=True)
    depths = _depths(present)
    below = depths.max(initial=0) - depths
    last_leaf = ((present + 1) << below) - 1
    sequence = np.lexsort((-depths, last_leaf))
    rank = np.argsort(sequence)
    return Elimination(
        np.argsort(rank[which], kind="stable"), present[sequence], np.cumsum(sizes[sequence])
    )


def fronts_of(lower: csc_array, ends: Integers) -> list[Front]:
    """The fronts of a matrix, in the order of elimination.

    Parameters
    ----------
    lower : csc_array of shape (V, V)
        Lower triangle of the matrix, its unknowns in the order of elimination.
    ends : integer array of shape (N,)
    """
    fronts: list[Front] = []
    children: list[list[int]] = [[] for _ in ends]
    start = 0
    for number, stop in enumerate(ends.tolist()):
        own = lower.indices[lower.indptr[start] : lower.indptr[stop]]
        passed_on = [fronts[child].rows for child in children[number]]
        rows = _distinct(np.concatenate([own, *passed_on]))
        front = Front(start, stop, rows[np.searchsorted(rows, stop) :], children[number])
        if len(front.rows):
            children[int(np.searchsorted(ends, front.rows[0], side="right"))].append(number)
        fronts.append(front)
        start = stop
    return fronts


def _depths(nodes: Integers) -> Integers:
    """How far below the root, which is node 1."""
    return np.asarray(np.frexp(nodes.astype(np.float64))[1] - 1, np.int64)


def _distinct(rows: Integers) -> Integers:
    """Each once, ascending (np.unique hashes, which is slower here)."""
    ascending = np.sort(rows)
    return ascending[np.diff(ascending, prepend=-1) > 0]
