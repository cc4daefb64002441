"""The assembly tree of a multifrontal factorisation: fronts and their order."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array

Integers = npt.NDArray[np.int64]

SHARED_DEPTH = 5
"""Subtrees below nodes of this depth are factored as one task."""


@dataclass(frozen=True)
class Front:
    """A front: unknowns that are eliminated together.

    Attributes
    ----------
    start, stop : int
        The unknowns are start..stop-1 in the order of elimination.
    rows : integer array of shape (B,)
        Later unknowns that the elimination updates, ascending.
    children : list of int
        Fronts whose first update is to this one.
    """

    start: int
    stop: int
    rows: Integers
    children: list[int]

    @property
    def n_entries(self) -> int:
        """Number of entries of the factor in this front."""
        size = self.stop - self.start
        return size * (size + len(self.rows))


@dataclass(frozen=True)
class Elimination:
    """An elimination order of the unknowns, node after node.

    Attributes
    ----------
    order : integer array of shape (V,)
        The unknowns in the order of elimination.
    nodes : integer array of shape (N,)
        Numbers of the nodes in the tree of `nested_dissection`, children before parents.
    ends : integer array of shape (N,)
        End of each node in the order.
    """

    order: Integers
    nodes: Integers
    ends: Integers

    def waves(self) -> list[list[range]]:
        """Tasks, each a range of fronts; tasks of a wave are independent of each other."""
        depths = _depths(self.nodes)
        owners = self.nodes >> np.maximum(depths - SHARED_DEPTH, 0)
        firsts = np.flatnonzero(np.diff(owners, prepend=-1))
        lasts = np.append(firsts[1:], len(owners))
        waves: list[list[range]] = [[] for _ in range(SHARED_DEPTH + 1)]
        for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
            waves[min(int(depths[last - 1]), SHARED_DEPTH)].append(range(first, last))
        return [wave for wave in waves[::-1] if wave]


def elimination_of(nodes: Integers) -> Elimination:
    """The elimination order of a dissection: subtree after subtree, children before parents.

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
    """Depth of each node below the root, which is node 1."""
    return np.asarray(np.frexp(nodes.astype(np.float64))[1] - 1, np.int64)


def _distinct(rows: Integers) -> Integers:
    """The distinct rows, ascending (np.unique hashes, which is slower here)."""
    ascending = np.sort(rows)
    return ascending[np.diff(ascending, prepend=-1) > 0]
