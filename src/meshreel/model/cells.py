"""Cells of a volume mesh, such as tetrahedra and hexahedra, whose boundary is the surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.kernel.cells import MAX_CELLS, MAX_NODES, CellSurface, cell_sizes, cell_surface
from meshreel.model.validation import frozen, restore
from meshreel.runtime.counting import counted

Int32s = npt.NDArray[np.int32]

SOLID_TYPES = (10, 12, 13, 14, 15, 16, 24, 25, 26, 27, 29, 32, 33)
"""Types of VTK with a volume."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a mesh, in the order of a file.

    The faces of the mesh are their surface: flat cells, and the sides of solids that no other solid
    shares, in the order of the cells, without the nodes between corners.

    Parameters
    ----------
    types : integer array of shape (N,)
        Cell types of VTK: 1, 3, 5, 9, 10, 12 to 16 (vertex, line, triangle, quad, tetrahedron,
        hexahedron, wedge, pyramid, pentagonal and hexagonal prism), 21 to 29 and 32 to 34 (the same
        with nodes on edges and sides, and inside).
    nodes : integer array of shape (n,)
        Vertex numbers of the nodes of all cells, concatenated, in the order of VTK 9.7.
    """

    types: npt.NDArray[np.uint8]
    nodes: Int32s
    __setstate__ = restore

    @property
    def n_cells(self) -> int:
        """Number of cells, N."""
        return len(self.types)

    @property
    def n_solids(self) -> int:
        """Number of cells with a volume."""
        return int(np.isin(self.types, SOLID_TYPES).sum())

    @cached_property
    def starts(self) -> npt.NDArray[np.int64]:
        """Index of the first node of each cell, then the number of all nodes, of shape (N + 1,)."""
        starts = np.zeros(len(self.types) + 1, np.int64)
        np.cumsum(cell_sizes()[self.types], out=starts[1:])
        return starts

    @property
    def size_bytes(self) -> int:
        """Size of its arrays."""
        return self.types.nbytes + self.nodes.nbytes

    def __repr__(self) -> str:
        return f"<Cells: {counted(self.n_cells, 'cell')}, {counted(self.n_solids, 'solid')}>"

    def surface(self, n_verts: int) -> CellSurface:
        """Return the triangles and polygons of the surface, and the cell of each polygon.

        Raises
        ------
        InvalidInputError
            If there is none, without solids and flat cells.
        """
        surface = cell_surface(self.types, self.nodes, n_verts)
        if not len(surface.triangles):
            raise InvalidInputError(
                f"{counted(self.n_cells, 'cell')} without a surface: a mesh needs flat cells, or "
                "solids with sides that no other solid shares"
            )
        return surface


def validated_cells(cells: Any, n_verts: int) -> Cells:
    """Return cells whose arrays are read-only and of the documented types.

    Raises
    ------
    InvalidInputError
        If an array has another shape or type, a cell type is unknown, the number of nodes does not
        match the types, or a node is no vertex.
    """
    if not isinstance(cells, Cells):
        raise InvalidInputError(f"cells must be meshreel.Cells; got {type(cells).__name__}")
    types, nodes = np.asarray(cells.types), np.asarray(cells.nodes)
    for name, array in (("types", types), ("nodes", nodes)):
        if array.ndim != 1 or array.dtype.kind not in "iu":
            raise InvalidInputError(
                f"{name} of cells must be integers of shape (N,); got {array.dtype} of "
                f"{array.shape}"
            )
    if not 1 <= len(types) <= MAX_CELLS or len(nodes) > MAX_NODES:
        raise InvalidInputError(
            f"cells are 1 to {MAX_CELLS}, with up to {MAX_NODES} nodes; got {len(types)} cells "
            f"with {len(nodes)} nodes"
        )
    is_known = (types >= 0) & (types < len(cell_sizes()))
    is_known &= cell_sizes()[np.where(is_known, types, 0)] > 0
    if not is_known.all():
        cell = int(np.argmin(is_known))
        raise InvalidInputError(f"cell {cell} has the type {types[cell]}, which is not supported")
    n_nodes = int(cell_sizes()[types].sum())
    if n_nodes != len(nodes):
        raise InvalidInputError(f"the types of cells imply {n_nodes} nodes; got {len(nodes)}")
    if not 0 <= nodes.min() <= nodes.max() < n_verts:
        raise InvalidInputError(f"nodes of cells must be vertices in 0..{n_verts - 1}")
    return Cells(
        frozen(np.ascontiguousarray(types, np.uint8)), frozen(np.ascontiguousarray(nodes, np.int32))
    )
