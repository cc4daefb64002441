"""Nested dissection: an order of elimination of a sparse symmetric matrix with little fill."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Members = npt.NDArray[np.integer]
Pairs = tuple[Members, Members]

PART_SIZE = 128
"""Parts of at most this many unknowns are not cut: as dense matrices they are fast enough."""

SMOOTHINGS = 20
"""Smoothing iterations of the function that is cut: distances in edges give jagged, longer cuts."""

SKEW = 0.8
"""Weight of the distance from the second end. With weights of 1 whole regions of a regular mesh
would be equally far from both: circles in edges are hexagons."""

MIN_SHARE_PERCENT = 35
"""Smallest share of the unknowns on a side of a cut; the cheapest of these cuts is taken."""


def nested_dissection(matrix: csc_array, graph: csr_array, part_size: int = PART_SIZE) -> Integers:
    """The node of a binary tree that each unknown belongs to, such that only ancestors are coupled.

    Node 1 is the root, and nodes 2k and 2k + 1 are the children of node k. The unknowns are cut in
    two recursively until parts are small; unknowns of one side that are coupled to the other are
    the separator: they belong to the node of the cut and take no part in later cuts. Two unknowns
    are coupled in the matrix only if the node of one is an ancestor of the other's, or the same.
    This holds for any graph; the graph determines the quality of the cuts.

    Parameters
    ----------
    matrix : csc_array of shape (V, V)
        Its pattern, which must be symmetric, is that of the couplings.
    graph : csr_array of shape (V, V)
        Symmetric; distances are counted along its entries, whose values do not matter. Fewer
        entries are faster: the mesh suffices where the matrix couples neighbours of neighbours.
    part_size : int

    Returns
    -------
    int64 array of shape (V,)

    References
    ----------
    A. George, "Nested dissection of a regular finite element mesh", 1973. R. J. Lipton, D. J.
    Rose, R. E. Tarjan, "Generalized nested dissection", 1979.
    """
    nodes = np.zeros(matrix.shape[0], np.int64)
    parts = np.ones(matrix.shape[0], np.int64)  # 0 once the node is found
    couplings, edges = _couplings(matrix), _entries(graph)
    while True:
        small = np.bincount(parts)[parts] <= part_size
        nodes[small] += parts[small]
        parts[small] = 0
        if not parts.any():
            return nodes
        parts = _cut(parts, edges)
        separating = _separators(parts, couplings)
        nodes[separating] = parts[separating] // 2
        parts[separating] = 0


def _entries(graph: csr_array) -> Pairs:
    rows = np.repeat(np.arange(graph.shape[0], dtype=np.int32), np.diff(graph.indptr))
    return rows, graph.indices


def _couplings(matrix: csc_array) -> Pairs:
    columns, rows = _entries(csr_array(matrix.T))
    once = columns < rows
    return columns[once], rows[once]


def _cut(parts: Integers, edges: Pairs) -> Integers:
    """Sides 2k and 2k + 1 of every part k; 0 stays 0."""
    graph = _within(parts, edges)
    order = _along(parts, graph)
    ordered = parts[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    sizes = np.diff(np.append(first, len(order)))
    places = np.arange(len(order))
    before = places - np.repeat(first, sizes) + 1
    costs = _cut_costs(_edges_across(order, graph), before, np.repeat(sizes, sizes))
    lowest = np.repeat(np.minimum.reduceat(costs, first), sizes)
    candidates = np.where(costs == lowest, places, len(order))
    chosen = np.repeat(np.minimum.reduceat(candidates, first), sizes)
    sides = np.zeros_like(parts)
    sides[order] = 2 * ordered + (places > chosen)
    sides[parts == 0] = 0
    return sides


def _along(parts: Integers, graph: csr_array) -> Integers:
    """The order of all unknowns by part, connected piece, and position from end to end.

    Connected pieces are contiguous, so that a cut divides at most one of them.
    """
    _, pieces = connected_components(graph, directed=False)
    members = _last_of_pieces(np.arange(len(parts)), pieces)
    across = _smoothed(_across(graph, members, pieces), graph)
    ranks = np.empty(len(members), np.int64)
    ranks[np.argsort(parts[members], kind="stable")] = np.arange(len(members))
    return np.argsort(ranks[pieces] * np.ptp(across) + across)


def _edges_across(order: Integers, graph: csr_array) -> Integers:
    """Number of edges that a cut after each position of an order crosses."""
    n = len(order)
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    ends, others = np.repeat(place, np.diff(graph.indptr)), place[graph.indices]
    once = ends < others
    opened = np.bincount(ends[once], minlength=n)
    return np.cumsum(opened - np.bincount(others[once], minlength=n))


def _cut_costs(n_edges: Integers, before: Integers, sizes: Integers) -> Floats:
    """Cut edges per unknown of the smaller side; infinite where that side is too small.

    Parameters
    ----------
    n_edges, before, sizes : integer arrays of shape (V,)
        Cut edges, unknowns of the part before the cut, unknowns of the part.
    """
    smaller = np.minimum(before, sizes - before)
    allowed = (smaller > 0) & (smaller >= sizes * MIN_SHARE_PERCENT // 100)
    return np.where(allowed, (n_edges + 1.0) / np.maximum(smaller, 1), np.inf)


def _within(parts: Integers, edges: Pairs) -> csr_array:
    """The graph without the entries that join different parts."""
    rows, columns = edges
    kept = (parts[rows] == parts[columns]) & (parts[rows] > 0)
    ends = np.cumsum(np.bincount(rows[kept], minlength=len(parts)))
    indptr = np.concatenate([[0], ends]).astype(np.int32)
    ones = np.ones(int(ends[-1]))
    return csr_array((ones, columns[kept], indptr), shape=(len(parts), len(parts)))


def _across(graph: csr_array, members: Members, pieces: Members) -> Floats:
    """Position of each unknown between the two ends of its piece, in edges.

    The ends are found from any member of the piece.
    """
    order, _ = _search(graph, members)
    order, above = _search(graph, _last_of_pieces(order[1:], pieces))
    from_one = _distances(order, above)
    from_other = _distances(*_search(graph, _last_of_pieces(order[1:], pieces)))
    return from_one - SKEW * from_other


def _search(graph: csr_array, sources: Members) -> Pairs:
    """Breadth-first order and predecessors; every piece has one source.

    An additional node, number V, is connected to all sources, so that one search covers all pieces;
    it is the first.
    """
    n = graph.shape[0]
    indptr = np.append(graph.indptr, graph.indptr[-1] + len(sources)).astype(np.int32)
    indices = np.append(graph.indices, sources).astype(np.int32)
    joined = csr_array((np.ones(len(indices)), indices, indptr), shape=(n + 1, n + 1))
    order, above = breadth_first_order(joined, n)
    return order, above


def _last_of_pieces(order: Members, pieces: Members) -> Members:
    """The last unknown of each piece; in a search none is farther from the source."""
    last = np.empty(int(pieces.max()) + 1, np.int64)
    last[pieces[order]] = order
    return last


def _distances(order: Members, above: Members) -> Integers:
    """Edges between each unknown and the source of its piece, from `_search`."""
    n = len(order) - 1
    place = np.empty(n + 1, np.int64)
    place[order] = np.arange(n + 1)
    # A layer ends after the last node that is reached from the layer before.
    n_reached = np.cumsum(np.bincount(place[above[order[1:]]], minlength=n + 1)).tolist()
    ends = [1]
    while ends[-1] <= n:
        ends.append(1 + n_reached[ends[-1] - 1])
    distances = np.empty(n + 1, np.int64)
    distances[order[1:]] = np.repeat(np.arange(len(ends) - 1), np.diff(ends))
    return distances[:n]


def _smoothed(values: Floats, graph: csr_array) -> Floats:
    counts = np.maximum(np.diff(graph.indptr), 1)
    for _ in range(SMOOTHINGS):
        values = (graph @ values) / counts
    return values


def _separators(sides: Integers, couplings: Pairs) -> npt.NDArray[np.bool_]:
    """Separators: the unknowns of one side coupled to the other, of the side with fewer of them."""
    one, other = (sides[ends] for ends in couplings)
    is_cut = (one != other) & (one > 0) & (other > 0)
    touching = np.zeros(len(sides), np.bool_)
    for ends in couplings:
        touching[ends[is_cut]] = True
    counts = np.bincount(sides[touching], minlength=2 * (int(sides.max()) // 2 + 1))
    odd_is_fewer = counts[1::2] < counts[0::2]
    return np.asarray(touching & (odd_is_fewer[sides // 2] == (sides % 2 == 1)))
