"""Exact diameter of a point cloud, also of flat ones."""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers

SLACK = 1e-13
"""Relative margin for rounding when points and pairs are excluded."""

FANOUT = 4
"""Children of each node of the tree of boxes."""

MAX_PAIRS = 1 << 18
"""Maximum number of node pairs compared at a time."""

CELLS = 1 << 16
"""Cells along each axis of the grid whose Z-order sorts the points."""


def diameter(points: Floats) -> float:
    """Largest distance between two of the points; 0 if they all coincide.

    Repeated jumps to the farthest point give a first pair at distance d. About its midpoint,
    ``|x - y|^2 = 2 |x|^2 + 2 |y|^2 - |x + y|^2`` shows that a longer pair needs
    ``|x|^2 + |y|^2 >= d^2 / 2``, which excludes most points. A tree of bounding boxes excludes
    most pairs of the others: for two nodes, the largest |x|^2 and |y|^2 and the gap between the
    boxes of x and -y bound the distance. Unlike a convex hull this needs no special case for
    planar, collinear or repeated points, and stays fast if every point is on the hull.

    Parameters
    ----------
    points : float64 array of shape (N, 3), N at least 1, with coordinates of magnitude about 1
    """
    first, second = _distant_pair(points)
    longest = float(np.linalg.norm(points[first] - points[second]))
    centered = points - (points[first] + points[second]) / 2
    squares = np.einsum("na,na->n", centered, centered)
    is_candidate = 2 * (squares + squares.max()) >= longest**2 * (1 - SLACK)
    candidates = np.unique(centered[is_candidate], axis=0)
    return _longest_pair(candidates[_z_order(candidates)], longest)


def _longest_pair(points: Floats, longest: float) -> float:
    """Largest distance between two of the points, or `longest` if none is farther apart.

    Parameters
    ----------
    points : float64 array of shape (N, 3)
        Neighbors in this order should be close. Nodes are runs of `FANOUT` points or nodes.
    """
    levels = [(points, points, np.einsum("na,na->n", points, points))]
    while len(levels[-1][0]) > FANOUT:
        low, high, square = levels[-1]
        starts = np.arange(0, len(low), FANOUT)
        levels.append(
            (
                np.minimum.reduceat(low, starts),
                np.maximum.reduceat(high, starts),
                np.maximum.reduceat(square, starts),
            )
        )
    pending = [(len(levels) - 1, *np.triu_indices(len(levels[-1][0])))]
    while pending:
        level, first, second = pending.pop()
        if len(first) > MAX_PAIRS:
            half = len(first) // 2
            pending.append((level, first[:half], second[:half]))
            pending.append((level, first[half:], second[half:]))
            continue
        low, high, square = levels[level]
        gaps = np.maximum(low[first] + low[second], -(high[first] + high[second]))
        np.maximum(gaps, 0.0, out=gaps)
        bounds = 2 * (square[first] + square[second]) - np.einsum("na,na->n", gaps, gaps)
        is_far = bounds >= longest**2 * (1 - SLACK)
        first, second = first[is_far], second[is_far]
        if level:
            pending.append((level - 1, *_children(first, second, len(levels[level - 1][0]))))
        else:
            offsets = points[first] - points[second]
            squares = np.einsum("na,na->n", offsets, offsets)
            longest = max(longest, float(np.sqrt(squares.max(initial=0))))
    return longest


def _children(first: Integers, second: Integers, n_nodes: int) -> tuple[Integers, Integers]:
    """All pairs of children of pairs of nodes, each once."""
    child, other = np.divmod(np.arange(FANOUT**2), FANOUT)
    first = (first[:, None] * FANOUT + child).ravel()
    second = (second[:, None] * FANOUT + other).ravel()
    exists = (first <= second) & (second < n_nodes)
    return first[exists], second[exists]


def _z_order(points: Floats) -> npt.NDArray[np.intp]:
    """Order of the points along a Z-curve, in which neighbors are close."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) * ((CELLS - 1) / (extent or 1.0))).astype(np.int64)
    codes = np.zeros(len(points), np.int64)
    for bit in range(CELLS.bit_length() - 1):
        for axis in range(3):
            codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(codes)


def _distant_pair(points: Floats) -> tuple[int, int]:
    first, second, largest = 0, 0, 0.0
    while True:
        offsets = points - points[second]
        squares = np.einsum("na,na->n", offsets, offsets)
        farthest = int(squares.argmax())
        if squares[farthest] <= largest:
            return first, second
        first, second, largest = second, farthest, float(squares[farthest])
