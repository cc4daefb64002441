"""Coding, surface and adjacency of cells, by the core."""

import ctypes
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.kernel.library import call, encoded
from meshreel.kernel.order import MAX_ITEM_BYTES

Int32s = npt.NDArray[np.int32]
Types = npt.NDArray[np.uint8]

MAX_CELLS, MAX_NODES = 1 << 26, 1 << 28
"""Largest numbers of cells, and of nodes of all cells together."""

MAX_NODE_BYTES, MAX_OVERHEAD_BYTES = 16, 64


class CellSurface(NamedTuple):
    """The polygons of the surface of cells, in the order of the cells."""

    triangles: Int32s
    """int32 array of shape (M, 3). A fan for each polygon."""
    sizes: Int32s
    owners: Int32s
    """int32 arrays of shape (P,). Corners of each polygon, and its cell."""


class EncodedCells(NamedTuple):
    """Cells in internal order."""

    data: bytes
    types: Types
    """uint8 array of shape (N,)."""
    nodes: Int32s
    """int32 array. As the decoder restores them."""
    given_cells: Int32s
    """int32 array of shape (N,). Input cell of each internal one."""
    internal_to_given: Integers
    """int64 array of shape (V,). Input vertex of each internal one."""


@cache
def cell_sizes() -> Int32s:
    """Number of nodes of each cell type of VTK, of shape (256,); 0 if it is not supported."""
    return np.array([call("reel_cell_size", code, noun="cells") for code in range(256)], np.int32)


def cell_surface(types: Types, nodes: Int32s, n_verts: int) -> CellSurface:
    """Return the polygons of flat cells, and the sides of solids that no other solid shares.

    Raises
    ------
    InvalidInputError
        If a type is unknown, or a node does not exist.
    """
    n_polygons = ctypes.c_int64()
    capacity = 0
    while True:
        surface = CellSurface(
            np.empty((capacity, 3), np.int32),
            np.empty(capacity, np.int32),
            np.empty(capacity, np.int32),
        )
        n_triangles = call(
            "reel_cells_surface",
            types,
            len(types),
            nodes,
            len(nodes),
            n_verts,
            capacity,
            *surface,
            ctypes.byref(n_polygons),
            noun="cells",
            memory_of=("reel_cells_memory", len(types), n_verts),
        )
        if n_triangles <= capacity:
            triangles, sizes, owners = surface
            n = n_polygons.value
            return CellSurface(triangles[:n_triangles], sizes[:n].copy(), owners[:n].copy())
        capacity = n_triangles


def cell_links(types: Types, nodes: Int32s, n_verts: int, *, of_cells: bool = False) -> Int32s:
    """Return the edges between nodes, or pairs of cells that share a side, as degenerate triangles.

    The result, of shape (L, 3) with rows a, b, b, represents a graph for functions that take faces.

    Raises
    ------
    InvalidInputError
        If a type is unknown, or a node does not exist.
    """
    n_items = len(types) if of_cells else n_verts
    starts = np.empty(n_items + 1, np.int32)
    near = np.empty(8 * len(types) if of_cells else 4 * len(nodes), np.int32)
    shape = len(types), len(nodes), n_verts, int(of_cells)
    n_near = call(
        "reel_cells_adjacency",
        types,
        len(types),
        nodes,
        *shape[1:],
        starts,
        near,
        noun="cells",
        memory_of=("reel_cells_adjacency_memory", *shape),
    )
    low, high = np.repeat(np.arange(n_items, dtype=np.int32), np.diff(starts)), near[:n_near]
    is_ascending = low < high  # each edge once
    low, high = low[is_ascending], high[is_ascending]
    return np.stack([low, high, high], axis=1)


def encode_cells(types: Types, nodes: Int32s, n_verts: int, *, listed: bool) -> EncodedCells:
    """Encode cells as a list in their order, or in the order of a walk from cell to cell.

    Raises
    ------
    InvalidInputError
        If a type is unknown, a node does not exist, or there are too many cells or nodes.
    """
    internal_types, internal_nodes = np.empty_like(types), np.empty_like(nodes)
    given_cells, internal_to_given = np.empty(len(types), np.int32), np.empty(n_verts, np.int32)
    data = encoded(
        "reel_cells_encode",
        types,
        len(types),
        nodes,
        len(nodes),
        n_verts,
        int(listed),
        internal_types,
        internal_nodes,
        given_cells,
        internal_to_given,
        noun="cells",
        capacity=MAX_NODE_BYTES * len(nodes) + MAX_OVERHEAD_BYTES,
        memory_of=("reel_cells_code_memory", len(types), len(nodes), n_verts),
    )
    order = internal_to_given.astype(np.int64)
    return EncodedCells(data, internal_types, internal_nodes, given_cells, order)


def encode_cells_order(cells: EncodedCells) -> bytes:
    """Encode the given order of cells and vertices that `encode_cells` returned."""
    n_cells, n_verts = len(cells.types), len(cells.internal_to_given)
    cell_order, vertex_order = np.empty(n_cells, np.int32), np.empty(n_verts, np.int32)
    cell_order[cells.given_cells] = np.arange(n_cells, dtype=np.int32)
    vertex_order[cells.internal_to_given] = np.arange(n_verts, dtype=np.int32)
    shape = n_cells, len(cells.nodes), n_verts
    return encoded(
        "reel_cells_order_encode",
        cells.types,
        n_cells,
        cells.nodes,
        *shape[1:],
        cell_order,
        vertex_order,
        noun="orders",
        capacity=MAX_ITEM_BYTES * (n_cells + n_verts + 1),
        memory_of=("reel_cells_order_memory", *shape),
    )
