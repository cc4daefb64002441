"""Hierarchy, prediction stencils and coding order of the vertices of a mesh."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.kernel.fields import CodingOrder, coding_order
from meshreel.kernel.mesh import Hierarchy, Neighbors, hierarchy, neighbors
from meshreel.model.sequence import Faces


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
