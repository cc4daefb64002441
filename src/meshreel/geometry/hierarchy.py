"""The vertices of a mesh in levels, from few to all, each next to vertices of levels before.

Everything is integer arithmetic on connectivity, so that encoder and decoder find the same
levels and stencils on every machine.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from meshreel.geometry.connectivity import neighbours_of

Integers = npt.NDArray[np.int64]
Keys = npt.NDArray[np.int32]

N_COLOURS = 3
"""Levels of a scale: the last takes what the others leave."""

REACH = 3
"""How far a stencil reaches, in edges of its scale."""

LARGEST_PASSAGE = 24
"""Stencils do not reach through vertices with more neighbours: hubs are next to everything."""

MAX_SCALES = 20
MAX_KEY = 2**31 - 1
CHUNK_TARGETS = 4096
"""Vertices whose stencils are looked for at once."""


@dataclass(frozen=True)
class Scale:
    """A graph of some vertices, and what of it is not in the graph of the next coarser scale.

    Attributes
    ----------
    members : integer array of shape (N,)
        Vertices of the graph, ascending.
    adjacency : csr_array of shape (N, N)
        Binary: which of them are next to each other.
    levels : list of integer arrays
        Vertices (not places in `members`) that are predicted at once.
    targets : integer array of shape (n,)
        All vertices of the levels, level after level.
    stencil : integer array of shape (n, S)
        For each target the nearest vertices of earlier levels and coarser scales, nearest first;
        -1 where there are no more within reach.
    hops : integer array of shape (n, S)
        How many edges of the graph away they are; 0 where there are no more.
    """

    members: Integers
    adjacency: csr_array
    levels: list[Integers]
    stencil: Integers
    hops: Integers

    @property
    def targets(self) -> Integers:
        """All vertices of the levels, level after level."""
        return np.concatenate([np.zeros(0, np.int64), *self.levels])


def build_hierarchy(adjacency: csr_array, stencil_size: int) -> list[Scale]:
    """Scales from the coarsest to the mesh itself; their levels hold every vertex once.

    The next coarser graph holds a maximal set of vertices of which no two are neighbours; two
    are next to each other there if cells around them touch. It ends where no edge is left: one
    vertex of every connected component makes the coarsest scale, with a single level and without
    stencils. The vertices that a scale adds go by colours: no two neighbours are in one level,
    but for the last.

    Parameters
    ----------
    adjacency : csr_array of shape (V, V)
        Symmetric, with an empty diagonal; its values do not matter.
    stencil_size : int
        S.

    References
    ----------
    M. Luby, "A simple parallel algorithm for the maximal independent set problem", 1986.
    """
    members, graph = np.arange(adjacency.shape[0]), adjacency
    scales: list[Scale] = []
    while graph.nnz and len(scales) < MAX_SCALES:
        ranks = scattered_ranks(members)
        kept = _independent(graph, np.ones(len(members), np.bool_), ranks)
        level_of = _colours(graph, kept, ranks)
        scales.append(_scale(members, graph, level_of, stencil_size))
        graph = _coarser(graph, kept)
        members = members[kept]
    nothing = np.zeros((len(members), 0), np.int64)
    scales.append(Scale(members, graph, [members], nothing, nothing))
    return scales[::-1]


def _colours(graph: csr_array, kept: npt.NDArray[np.bool_], ranks: Integers) -> Integers:
    """Level of each vertex in its scale: 0 of those that the coarser scale has, then 1, 2, ..."""
    level_of = np.where(kept, 0, N_COLOURS)
    left = ~kept
    for colour in range(1, N_COLOURS):
        chosen = _independent(graph, left, ranks)
        level_of[chosen] = colour
        left &= ~chosen
    return level_of


def _scale(members: Integers, graph: csr_array, level_of: Integers, stencil_size: int) -> Scale:
    levels = [np.flatnonzero(level_of == level) for level in range(1, N_COLOURS + 1)]
    levels = [level for level in levels if len(level)]
    targets = np.concatenate(levels)
    stencil, hops = nearest_earlier(graph, level_of, targets, stencil_size)
    return Scale(
        members,
        graph,
        [members[level] for level in levels],
        np.where(stencil >= 0, members[stencil], -1),
        hops,
    )


def nearest_earlier(
    graph: csr_array, level_of: Integers, targets: Integers, n_nearest: int
) -> tuple[Integers, Integers]:
    """For each target the vertices of lower levels nearest to it, and their distances in edges.

    Parameters
    ----------
    graph : csr_array of shape (N, N)
    level_of : integer array of shape (N,)
    targets : integer array of shape (n,)
    n_nearest : int
        S.

    Returns
    -------
    stencil, hops : integer arrays of shape (n, S)
        Nearest first, then lowest vertex first; -1 and 0 where fewer are within `REACH`.
    """
    stencil = np.full((len(targets), n_nearest), -1, np.int64)
    hops = np.zeros((len(targets), n_nearest), np.int64)
    size = max(1, min(CHUNK_TARGETS, MAX_KEY // graph.shape[0]))
    for start in range(0, len(targets), size):
        rows = slice(start, start + size)
        _find_nearest(graph, level_of, targets[rows], stencil[rows], hops[rows])
    return stencil, hops


def _find_nearest(
    graph: csr_array, level_of: Integers, targets: Integers, stencil: Integers, hops: Integers
) -> None:
    """Fill in stencils: rings of vertices grow around each target until they hold enough."""
    n_verts = graph.shape[0]
    degrees = np.diff(graph.indptr)
    n_found = np.zeros(len(targets), np.int64)
    # A pair of a target (its number) and a vertex is one key: they sort fast.
    growing = ring = (np.arange(len(targets)) * n_verts + targets).astype(np.int32)
    before = ring[:0]
    for distance in range(1, REACH + 1):
        first, last = np.divmod(growing, np.int32(n_verts))
        counts, near = neighbours_of(graph, last)
        around = np.repeat(first * np.int32(n_verts), counts) + near
        before, ring = ring, _without(_without(_distinct(around), ring), before)
        first, last = np.divmod(ring, np.int32(n_verts))
        is_earlier = level_of[last] < level_of[targets[first]]
        _append(stencil, hops, n_found, first[is_earlier], last[is_earlier], distance)
        grows = (n_found[first] < stencil.shape[1]) & (degrees[last] <= LARGEST_PASSAGE)
        growing = ring[grows]
        if not len(growing):
            break


def _append(
    stencil: Integers, hops: Integers, n_found: Integers, rows: Keys, members: Keys, distance: int
) -> None:
    """Put members, which come row by row and ascending, behind those found so far."""
    counts = np.bincount(rows, minlength=len(stencil))
    rank = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts) + n_found[rows]
    fits = rank < stencil.shape[1]
    stencil[rows[fits], rank[fits]] = members[fits]
    hops[rows[fits], rank[fits]] = distance
    n_found += counts


def _distinct(values: Keys) -> Keys:
    """Each value once, ascending (np.unique hashes, which is slower here)."""
    ascending = np.sort(values, kind="stable")  # made for what is nearly in order
    is_first = np.ones(len(ascending), np.bool_)
    is_first[1:] = ascending[1:] != ascending[:-1]
    return np.asarray(ascending[is_first])


def _without(values: Keys, removed: Keys) -> Keys:
    """Ascending values that are not among others, ascending too."""
    if not len(removed):
        return values
    place = np.minimum(np.searchsorted(removed, values), len(removed) - 1)
    return np.asarray(values[removed[place] != values])


def _independent(
    graph: csr_array, among: npt.NDArray[np.bool_], ranks: Integers
) -> npt.NDArray[np.bool_]:
    """Some of the vertices, no two of them neighbours, as many as fit."""
    chosen = np.zeros(len(among), np.bool_)
    free = among.copy()
    while free.any():
        candidates = np.where(free, ranks, -1)
        found = free & (candidates > _highest_near(graph, candidates))
        chosen |= found
        free &= ~found & (_highest_near(graph, found.astype(np.int64)) < 1)
    return chosen


def _coarser(graph: csr_array, kept: npt.NDArray[np.bool_]) -> csr_array:
    """Graph of the kept vertices: cells of a vertex and its neighbours touch along an edge."""
    number = np.cumsum(kept) - 1
    # A vertex that is not kept has a kept neighbour: the set is maximal.
    cell = np.where(kept, number, _highest_near(graph, np.where(kept, number, -1)))
    rows = np.repeat(cell, np.diff(graph.indptr))
    columns = cell[graph.indices]
    apart = rows != columns
    n_kept = int(kept.sum())
    ones = np.ones(int(apart.sum()), np.int8)
    touching = coo_array((ones, (rows[apart], columns[apart])), shape=(n_kept, n_kept)).tocsr()
    touching.data[:] = 1
    touching.sort_indices()
    return csr_array(touching)


def _highest_near(graph: csr_array, values: Integers) -> Integers:
    """The highest value of the neighbours of each vertex; -1 where there are none."""
    connected = np.flatnonzero(np.diff(graph.indptr))
    highest = np.full(graph.shape[0], -1, np.int64)
    if len(connected):
        around = values[graph.indices]
        highest[connected] = np.maximum.reduceat(around, graph.indptr[connected])
    return highest


def scattered_ranks(numbers: Integers) -> Integers:
    """Ranks 0..N-1 that show no order: those of a hash."""
    ranks = np.empty(len(numbers), np.int64)
    ranks[np.argsort(scattered(numbers), kind="stable")] = np.arange(len(numbers))
    return ranks


def scattered(numbers: Integers) -> npt.NDArray[np.uint64]:
    """A 64-bit hash of each number, the same on every machine (a multiplicative one, twice)."""
    mixed = numbers.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= mixed >> np.uint64(31)
    return mixed * np.uint64(0xBF58476D1CE4E5B9)
