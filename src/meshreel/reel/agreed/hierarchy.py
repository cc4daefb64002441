"""A multiresolution hierarchy: the vertices of a mesh in levels, each near those of earlier ones.

Everything is integer arithmetic on connectivity, so that encoder and decoder find the same
levels and stencils on every machine.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from meshreel.geometry.connectivity import neighbours_of
from meshreel.runtime.threads import chunks, in_threads

Integers = npt.NDArray[np.int64]
Levels = npt.NDArray[np.int8]
Indices = npt.NDArray[np.integer]
Keys = npt.NDArray[np.int32]
Chosen = npt.NDArray[np.bool_]

N_COLOURS = 3
"""Levels of a resolution: the last takes the vertices that the others leave."""

REACH = 3
"""How far a stencil reaches, in edges of its resolution."""

LARGEST_PASSAGE = 24
"""Stencils do not reach through vertices with more neighbours: hubs are next to everything."""

MAX_RESOLUTIONS = 20
KEY_BITS = 31
CHUNK_PREDICTED = 2048
"""Vertices whose stencils are looked for at once: their keys should stay in the cache."""


@dataclass(frozen=True)
class Resolution:
    """A graph of some vertices, and those of them that the next coarser graph lacks.

    Attributes
    ----------
    members : integer array of shape (N,)
        Vertices of the graph, ascending.
    adjacency : csr_array of shape (N, N)
        Binary: which of them are next to each other.
    levels : list of integer arrays
        Vertices (not places in `members`) that are predicted at once.
    predicted : integer array of shape (n,)
        All vertices of the levels, level after level.
    stencil : integer array of shape (n, S)
        The nearest vertices of earlier levels and coarser resolutions, nearest first; -1 where
        there are no more within reach.
    hops : integer array of shape (n, S)
        How many edges of the graph away they are; 0 where there are no more.
    """

    members: Integers
    adjacency: csr_array
    levels: list[Integers]
    stencil: Integers
    hops: Integers

    @property
    def predicted(self) -> Integers:
        """All vertices of the levels, level after level."""
        return np.concatenate([np.zeros(0, np.int64), *self.levels])


def build_hierarchy(adjacency: csr_array, stencil_size: int) -> list[Resolution]:
    """Resolutions from the coarsest to the mesh itself; their levels hold every vertex once.

    The next coarser graph holds a maximal set of vertices of which no two are neighbours; two
    are next to each other there if cells around them touch. It ends where no edge is left: one
    vertex of every connected component makes the coarsest resolution, with a single level and
    without stencils. The vertices that a resolution adds go by colours: no two neighbours are in
    one level, but for the last.

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
    ranks = scattered_ranks(members)
    resolutions: list[Resolution] = []
    while graph.nnz and len(resolutions) < MAX_RESOLUTIONS:
        rises = _rising_edges(graph, ranks)
        kept = _independent(rises, np.ones(len(members), np.bool_))
        level_of = _colours(rises, kept)
        resolutions.append(_resolution(members, graph, level_of, stencil_size))
        graph = _coarser(graph, kept)
        members, ranks = members[kept], ranks[kept]
    nothing = np.zeros((len(members), 0), np.int64)
    resolutions.append(Resolution(members, graph, [members], nothing, nothing))
    return resolutions[::-1]


def _colours(rises: tuple[Indices, Indices], kept: Chosen) -> Levels:
    """Level of each vertex in its resolution: 0 of those in the coarser one, then 1, 2, ..."""
    level_of = np.where(kept, 0, N_COLOURS).astype(np.int8)
    left = ~kept
    for colour in range(1, N_COLOURS):
        chosen = _independent(rises, left)
        level_of[chosen] = colour
        left &= ~chosen
    return level_of


def _resolution(
    members: Integers, graph: csr_array, level_of: Levels, stencil_size: int
) -> Resolution:
    levels = [np.flatnonzero(level_of == level) for level in range(1, N_COLOURS + 1)]
    levels = [level for level in levels if len(level)]
    predicted = np.concatenate(levels)
    stencil, hops = nearest_earlier(graph, level_of, predicted, stencil_size)
    return Resolution(
        members,
        graph,
        [members[level] for level in levels],
        np.where(stencil >= 0, members[stencil], -1),
        hops,
    )


def nearest_earlier(
    graph: csr_array, level_of: Indices, predicted: Integers, n_nearest: int
) -> tuple[Integers, Integers]:
    """Vertices of lower levels nearest to each predicted one, and their distances in edges.

    Parameters
    ----------
    graph : csr_array of shape (N, N)
    level_of : integer array of shape (N,)
    predicted : integer array of shape (n,)
    n_nearest : int
        S.

    Returns
    -------
    stencil, hops : integer arrays of shape (n, S)
        Nearest first, then lowest vertex first; -1 and 0 where fewer are within `REACH`.
    """
    stencil = np.full((len(predicted), n_nearest), -1, np.int64)
    hops = np.zeros((len(predicted), n_nearest), np.int64)
    size = min(CHUNK_PREDICTED, 1 << max(0, KEY_BITS - _vertex_bits(graph)))

    def find(rows: slice) -> None:
        _find_nearest(graph, level_of, predicted[rows], stencil[rows], hops[rows])

    in_threads(find, chunks(len(predicted), size))
    return stencil, hops


def _vertex_bits(graph: csr_array) -> int:
    """Bits of a key that hold a vertex, and whether it is new."""
    return int(graph.shape[0]).bit_length() + 1


def _find_nearest(
    graph: csr_array,
    level_of: Indices,
    predicted: Integers,
    stencil: Integers,
    hops: Integers,
) -> None:
    """Fill in stencils: rings of vertices grow around each predicted one until they hold enough."""
    bits = _vertex_bits(graph)
    degrees = np.diff(graph.indptr)
    own_level = level_of[predicted]
    n_found = np.zeros(len(predicted), np.int64)
    # A predicted vertex (its number), a vertex and whether it is new are one key: they sort fast.
    row, last = np.arange(len(predicted), dtype=np.int32), predicted
    seen = (row << bits) + 2 * last.astype(np.int32)
    for distance in range(1, REACH + 1):
        counts, near = neighbours_of(graph, last)
        around = np.repeat(row << bits, counts) + 2 * near + 1
        if distance == REACH:  # nothing grows from there
            around = around[level_of[near] < np.repeat(own_level[row], counts)]
        seen, ring = _parted(seen, around)
        row, last = ring >> bits, (ring & ((1 << bits) - 1)) >> 1
        is_earlier = level_of[last] < own_level[row]
        _append(stencil, hops, n_found, row[is_earlier], last[is_earlier], distance)
        grows = (n_found < stencil.shape[1])[row] & (degrees[last] <= LARGEST_PASSAGE)
        row, last = row[grows], last[grows]
        if not len(row):
            break


def _append(
    stencil: Integers,
    hops: Integers,
    n_found: Integers,
    rows: Indices,
    members: Indices,
    distance: int,
) -> None:
    """Put members, which come row by row and ascending, behind those found so far."""
    counts = np.bincount(rows, minlength=len(stencil))
    rank = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts) + n_found[rows]
    fits = rank < stencil.shape[1]
    stencil[rows[fits], rank[fits]] = members[fits]
    hops[rows[fits], rank[fits]] = distance
    n_found += counts


def _parted(seen: Keys, around: Keys) -> tuple[Keys, Keys]:
    """All keys as seen ones, and those that are new, each once, ascending.

    Keys that are seen are even; the same key, seen now, is higher by one.
    """
    keys = np.concatenate([seen, around])
    keys.sort(kind="stable")  # made for keys that are nearly in order
    is_first = np.ones(len(keys), np.bool_)
    is_first[1:] = (keys[1:] ^ keys[:-1]) > 1
    keys = keys[is_first]
    return keys & ~1, keys[(keys & 1) > 0]


def _rising_edges(graph: csr_array, ranks: Integers) -> tuple[Indices, Indices]:
    """The lower end and the higher end, by rank, of every edge; ranks need not be 0, 1, ..."""
    ends, others = _ends(graph)
    rises = ranks[ends] < ranks[others]
    return ends[rises], others[rises]


def _ends(graph: csr_array) -> tuple[Indices, Indices]:
    """Both ends of every edge, once from either end."""
    return np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr)), graph.indices


def _independent(rises: tuple[Indices, Indices], among: Chosen) -> Chosen:
    """Some of the vertices, no two of them neighbours, as many as fit: the highest go first."""
    low, high = rises
    free, chosen = among.copy(), np.zeros(len(among), np.bool_)
    while free.any():
        is_left = free[low] & free[high]
        low, high = low[is_left], high[is_left]
        found = free.copy()
        found[low] = False
        chosen |= found
        free &= ~found
        free[low[found[high]]] = False
    return chosen


def _coarser(graph: csr_array, kept: Chosen) -> csr_array:
    """Graph of the kept vertices: cells of a vertex and its neighbours touch along an edge."""
    n_kept = int(kept.sum())
    ends, others = _ends(graph)
    cell = np.cumsum(kept) - 1
    # A vertex that is not kept has a kept neighbour: the set is maximal. The last is the highest.
    is_link = kept[others] & ~kept[ends]
    inner, middle = ends[is_link], others[is_link]
    is_last = np.diff(inner, append=-1) != 0
    cell[inner[is_last]] = cell[middle[is_last]]
    rows, columns = cell[ends], cell[others]
    apart = rows != columns
    ones = np.ones(int(apart.sum()), np.int8)
    touching = coo_array((ones, (rows[apart], columns[apart])), shape=(n_kept, n_kept)).tocsr()
    touching.data[:] = 1
    touching.sort_indices()
    return csr_array(touching)


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
