"""Edges, isolated vertices and boundary of any triangle list.

A degenerate face (with a repeated vertex) contributes its edges between different vertices;
duplicate faces contribute their edges once; a vertex without an edge is isolated.
"""

import numpy as np

from meshreel.arrays import Integers
from meshreel.model.sequence import Faces


def undirected_edges(faces: Faces) -> Integers:
    """Unique edges, of shape (E, 2), lower vertex first, sorted."""
    return _edges_and_face_counts(faces)[0]


def component_labels(faces: Faces, n_verts: int) -> Integers:
    """Number of the connected component of each vertex, of shape (V,).

    Components are numbered by their lowest vertex; an isolated vertex is a component.
    """
    labels = lowest_connected(n_verts, *undirected_edges(faces).T)
    return np.unique(labels, return_inverse=True)[1]


def face_components(faces: Faces, n_verts: int) -> Integers:
    """Number of the connected component of each face, of shape (M,), from 0 without gaps."""
    return np.unique(component_labels(faces, n_verts)[faces[:, 0]], return_inverse=True)[1]


def lowest_connected(n_items: int, first: Integers, second: Integers) -> Integers:
    """The lowest item connected to each item by pairs (first, second), of shape (n_items,).

    Every root of a tree that a pair joins to a lower root becomes its child; then all items point
    to their roots, and pairs within a tree are dropped (Shiloach and Vishkin 1982).
    """
    roots = np.arange(n_items)
    low, high = np.minimum(first, second), np.maximum(first, second)
    while len(low):
        np.minimum.at(roots, high, low)
        while not np.array_equal(above := roots[roots], roots):
            roots = above
        first, second = roots[low], roots[high]
        is_open = first != second
        first, second = first[is_open], second[is_open]
        low, high = np.minimum(first, second), np.maximum(first, second)
    return roots


def isolated_vertices(faces: Faces, n_verts: int) -> Integers:
    """Vertices without an edge, ascending."""
    has_edge = np.zeros(n_verts, bool)
    for corner in range(3):
        differs = (faces[:, corner, None] != faces).any(axis=1)
        has_edge[faces[differs, corner]] = True
    return np.flatnonzero(~has_edge)


def boundary_edges(faces: Faces) -> Integers:
    """Edges that belong to exactly one face, of shape (B, 2)."""
    edges, counts = _edges_and_face_counts(faces)
    return np.asarray(edges[counts == 1], np.int64)


def _edges_and_face_counts(faces: Faces) -> tuple[Integers, Integers]:
    """Sorted edges of shape (E, 2), and the number of face sides on each."""
    starts = faces.astype(np.int64).ravel()
    ends = np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    # One key per edge: sorting keys is many times faster than sorting pairs.
    size = high.max(initial=0) + 1
    keys, counts = np.unique((low * size + high)[low != high], return_counts=True)
    return np.stack([keys // size, keys % size], axis=1), counts
