"""Graphs of faces, corners and rows, over which their tracks are predicted.

Faces are adjacent across an edge; corners within a triangle, and across an edge at the same vertex;
rows if any of their corners are; cells if they share a face. `docs/format.md`, "Tracks".
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.codec.corner_rows import CornerRows
from meshreel.kernel.cells import cell_links
from meshreel.kernel.mesh import item_faces
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface


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
