"""What the stored values of a track lie on, and how they go out.

`docs/format.md`, "Tracks".
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.corner_rows import CornerRows, read_corner_rows
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.tracks import Sharing, TrackHeader
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.geometry.fans import join_fans
from meshreel.reel.agreed.graphs import ItemGraph, item_graph, row_graph
from meshreel.sequence import Faces
from meshreel.surface import Domain, Surface

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class StoredItems:
    """What the stored values of a track lie on.

    Attributes
    ----------
    graph : ItemGraph
        Of n vertices, faces, corners or rows.
    order : integer array of shape (n,)
        The item of the graph that each value is of.
    spread : integer array of shape (N,), or None
        The value that each corner has, where corners share them; None: values go out as they are.
    vertex_of_row : integer array of shape (n,), or None
        As it goes out, where values are of rows.
    """

    graph: ItemGraph
    order: Integers
    spread: Integers | None = None
    vertex_of_row: Integers | None = None

    @property
    def most_items(self) -> int:
        """Items that values are decoded for: those stored, or the corners, if these are more."""
        n_corners = 0 if self.spread is None else len(self.spread)
        return max(self.graph.n_items, n_corners)


def items_of(opened: OpenStream, header: TrackHeader) -> StoredItems:
    """What the values of a track of a stream lie on.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If connectivity, surface or rows are damaged.
    """
    graph = ItemGraph(opened.internal_faces, opened.n_verts)
    if header.stored_domain is not Domain.VERTEX and header.sharing is Sharing.NONE:
        graph = item_graph(header.domain, opened.faces, opened.surface, opened.n_verts)
        return StoredItems(graph, np.arange(graph.n_items))
    if header.sharing is Sharing.NONE:
        return StoredItems(graph, opened.order)
    vertices = vertices_of_corners(opened.faces, opened.surface)
    if header.sharing is Sharing.VERTICES:
        return StoredItems(graph, opened.order, vertices)
    rows = read_corner_rows(header.rows, opened.order[vertices], opened.n_verts)
    graph = row_graph(rows, opened.faces, opened.surface, opened.n_verts)
    of_rows = vertices_of_rows(rows, vertices, opened.order)
    return StoredItems(graph, np.arange(rows.n_rows), rows.of_corners, of_rows)


def vertices_of_corners(faces: Faces, surface: Surface) -> Integers:
    """The vertex of each corner of the polygons of a mesh, shape (N,); all as they go out."""
    return join_fans(surface.sizes(len(faces)), faces).astype(np.int64)


def vertices_of_rows(rows: CornerRows, vertices: Integers, order: Integers) -> Integers:
    """The vertex, as it goes out, of each row.

    Parameters
    ----------
    rows : CornerRows
    vertices : integer array of shape (N,)
        Of corners, as they go out.
    order : integer array of shape (V,)
        Internal number of each vertex that goes out.
    """
    found = np.empty(rows.n_rows, np.int64)
    found[: len(order)] = inverse_permutation(order)
    found[rows.of_corners] = vertices
    return found
