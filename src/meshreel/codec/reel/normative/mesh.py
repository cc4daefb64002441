"""Hierarchy, prediction stencils and coding order of the vertices of a mesh, or of other items.

The graph of items has the form of a mesh. Faces are adjacent across an edge; corners within a
triangle, and across an edge at the same vertex; rows if any of their corners are; cells if they
share a face. `docs/format.md`, "Tracks".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.corner_rows import CornerRows
from meshreel.kernel.cells import cell_links
from meshreel.kernel.fields import CodingOrder, coding_order
from meshreel.kernel.mesh import Hierarchy, Neighbors, hierarchy, item_faces, neighbors
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface


@dataclass(frozen=True)
class FieldMesh:
    """A mesh, with the hierarchy that encoder and decoder derive from its connectivity."""

    faces: Faces
    """int32 array of shape (M, 3). In internal order, like all vertices here."""
    n_verts: int
    stencil_size: int
    """Number of vertices that predict one."""

    @cached_property
    def neighbors(self) -> Neighbors:
        """Adjacent vertices of each vertex."""
        return neighbors(self.faces, self.n_verts)

    @cached_property
    def hierarchy(self) -> Hierarchy:
        """All vertices in coding order, with their stencils."""
        return hierarchy(self.neighbors, self.stencil_size)

    @property
    def order(self) -> npt.NDArray[np.int32]:
        """Vertices in coding order: coarsest resolution first, level by level."""
        return self.hierarchy.order

    @cached_property
    def number(self) -> Integers:
        """Position of each vertex in coding order."""
        return inverse_permutation(self.order)

    @cached_property
    def coding_order(self) -> CodingOrder:
        """Coding order with context neighbors; one pass per resolution."""
        levels = self.hierarchy
        is_last = np.diff(levels.level_resolutions, append=-1) != 0
        ends = levels.level_starts[1:][is_last]
        return coding_order(levels.contexts, np.concatenate([[0], ends]).astype(np.int64))


class ItemGraph(NamedTuple):
    """A graph of items in the form of a mesh, for `FieldMesh`."""

    faces: Faces
    """int32 array of shape (n, 3). Triples of adjacent items; a pair repeats its second item."""
    n_items: int


def item_graph(
    domain: Domain, faces: Faces, surface: Surface, n_verts: int, rows: CornerRows | None = None
) -> ItemGraph:
    """Return the graph of the polygons of a decoded mesh, their corners, rows of these, or cells.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface
        Maps polygons to triangles.
    """
    if domain is Domain.CELL:
        cells = surface.cells
        assert cells is not None
        links = cell_links(cells.types, cells.nodes, n_verts, of_cells=True)
        return ItemGraph(links, cells.n_cells)
    sizes = surface.sizes(len(faces))
    items: npt.NDArray[np.integer]
    if domain is Domain.FACE:
        items, n_items = np.repeat(np.arange(len(sizes)), 3 * (sizes - 2)), len(sizes)
    elif rows is None:
        items, n_items = triangle_corners(sizes, faces), int(sizes.sum())
    else:
        items, n_items = rows.of_corners[triangle_corners(sizes, faces)], rows.n_rows
    return ItemGraph(item_faces(faces, n_verts, items), n_items)
