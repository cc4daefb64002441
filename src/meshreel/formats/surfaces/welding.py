"""Welding of corners that coincide in every frame, and of surfaces that files split along seams."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Attribute, Domain, Kind
from meshreel.runtime.counting import counted

Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SplitMesh:
    """Vertices as in the file, and the welded vertices that they belong to."""

    vertex_of: Numbers
    """int64 array of shape (N,). The welded vertex of each vertex of the file."""
    first: Numbers
    """int64 array of shape (V,). The first vertex of the file of each welded vertex."""
    corners: Numbers
    """int64 array of shape (3 M,). The vertex of the file at each corner of the triangles."""

    def attribute(self, name: str, kind: Kind, rows: npt.NDArray[Any]) -> Attribute:
        """Return values of shape (N, C) as an attribute of vertices or corners.

        It is one of vertices if the values agree on all vertices of the file that are welded.
        """
        bits = np.ascontiguousarray(rows).view(f"u{rows.itemsize}")
        if (bits[self.first[self.vertex_of]] == bits).all():
            return Attribute(name, kind, Domain.VERTEX, rows[self.first])
        row_of, representatives = weld_rows([rows])
        indices = row_of[self.corners].astype(np.int32)
        return Attribute(name, kind, Domain.CORNER, rows[representatives], indices)


class RowGroups:
    """Groups of rows that are bitwise equal in all arrays so far.

    Attributes
    ----------
    labels : int64 array of shape (N,)
        Group of each row, numbered by first occurrence; replaced when groups are split.
    representatives : int64 array
        First row of each group, ascending.
    """

    def __init__(self) -> None:
        self.labels: Numbers = np.empty(0, np.int64)
        self.representatives: Numbers = np.empty(0, np.int64)

    def add(self, rows: npt.NDArray[Any]) -> None:
        """Split groups by an array of shape (N, C), without negative zeros; C may differ."""
        bits = np.ascontiguousarray(rows).view(f"u{rows.itemsize}")
        if not len(self.labels):
            self.labels, self.representatives = _split(np.zeros(len(bits), np.int64), bits)
        elif (bits.take(self.representatives[self.labels], axis=0) != bits).any():
            self.labels, self.representatives = _split(self.labels, bits)


class CornerWelder(RowGroups):
    """Welds corners whose positions, of shape (3 M, 3), are bitwise equal in all frames."""

    @property
    def faces(self) -> Faces:
        """The welded vertex of each corner, of shape (M, 3)."""
        return self.labels.reshape(-1, 3).astype(np.int32)

    @property
    def description(self) -> str:
        """A sentence on the welded corners, for notes."""
        n_corners, n_verts = len(self.labels), len(self.representatives)
        return f"welded {counted(n_corners, 'STL corner')} to {counted(n_verts, 'vertex')}"


def weld_rows(blocks: Iterable[npt.NDArray[Any]]) -> tuple[Numbers, Numbers]:
    """Return labels and representatives of rows that are equal in all arrays: `RowGroups`."""
    groups = RowGroups()
    for rows in blocks:
        groups.add(rows)
    return groups.labels, groups.representatives


def _split(labels: Numbers, bits: npt.NDArray[np.unsignedinteger]) -> tuple[Numbers, Numbers]:
    """Split groups wherever `bits` differ; groups are numbered by their first row."""
    order = np.lexsort((*bits.T, labels))
    labels, bits = labels[order], bits[order]
    differs = (labels[1:] != labels[:-1]) | (bits[1:] != bits[:-1]).any(axis=1)
    is_first = np.concatenate([[True], differs])
    first_rows = order[is_first]  # lexsort is stable: the lowest row of each group comes first
    ranks = np.empty(len(first_rows), np.int64)
    ranks[np.argsort(first_rows)] = np.arange(len(first_rows))
    new_labels = np.empty(len(labels), np.int64)
    new_labels[order] = ranks[np.cumsum(is_first) - 1]
    return new_labels, np.sort(first_rows)


def weld_seams(points: Vertices, triangles: Numbers) -> SplitMesh:
    """Weld points along the seams of a surface, where pairs of boundary edges coincide.

    Two boundary edges are joined if they connect equal positions in opposite directions, and no
    other boundary edge connects these. Equal positions elsewhere stay apart: with
    coarsely rounded positions, welding them would collapse triangles and connect sheets that touch.

    Parameters
    ----------
    points : float array of shape (N, 3)
        Without negative zeros.
    triangles : int64 array of shape (M, 3)
        Indices in 0..N-1.
    """
    n_points, starts, ends = len(points), triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    half_edges, opposite = starts * n_points + ends, np.sort(ends * n_points + starts)
    # np.isin hashes, which takes ten times as long.
    nearest = opposite.take(np.searchsorted(opposite, half_edges), mode="clip")
    boundary = np.flatnonzero(nearest != half_edges)
    starts, ends = starts[boundary], ends[boundary]
    position_of, _ = weld_rows([points])
    low, high = np.sort([position_of[starts], position_of[ends]], axis=0)
    _, seams, counts = np.unique(low * n_points + high, return_inverse=True, return_counts=True)
    is_pair = (counts == 2)[seams] & (low < high)
    pairs = np.flatnonzero(is_pair)[np.argsort(seams[is_pair], kind="stable")].reshape(-1, 2)
    are_opposite = position_of[starts[pairs[:, 0]]] == position_of[ends[pairs[:, 1]]]
    # Two sides of a triangle coincide if its third has no length.
    are_apart = boundary[pairs[:, 0]] // 3 != boundary[pairs[:, 1]] // 3
    first_edge, second_edge = pairs[are_opposite & are_apart].T
    links = np.concatenate(
        [[starts[first_edge], ends[second_edge]], [ends[first_edge], starts[second_edge]]], axis=1
    )
    vertex_of, first = weld_rows([_component_minima(links, n_points)[:, np.newaxis]])
    return SplitMesh(vertex_of, first, triangles.ravel())


def _component_minima(links: Numbers, n_points: int) -> Numbers:
    """The lowest point of the connected component of each point.

    Parameters
    ----------
    links : int64 array of shape (2, L)
        Pairs of points.
    """
    lowest = np.arange(n_points)
    while (lowest[links[0]] != lowest[links[1]]).any():
        roots, other_roots = lowest[links]
        np.minimum.at(lowest, np.maximum(roots, other_roots), np.minimum(roots, other_roots))
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
    return lowest
