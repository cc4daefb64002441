"""The mesh as `reel` codes it: a hierarchy of its vertices, their stencils and coding passes."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.kernel.fields import CodingOrder, order_of_rows
from meshreel.kernel.mesh import Hierarchy, Neighbors, hierarchy, neighbors
from meshreel.kernel.predict import Prepared, prepared_weights
from meshreel.model.sequence import Faces
from meshreel.runtime.profiling import staged

MOST_PREPARED = 1 << 16
"""Vertices of meshes for which prepared weights are kept: 608 bytes each, 40 MB at most."""

Connectivity = tuple[bytes, int, int]
"""Faces as the bytes of int32, number of vertices, stencil size."""


@dataclass(frozen=True)
class FieldMesh:
    """All that both sides derive from connectivity, whatever the quantisation step.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
        In internal order, as everything here.
    n_verts : int
    stencil_size : int
        Vertices that predict one.

    Only connectivity is pickled. A process that is given the same one again finds the derived
    parts it had before.
    """

    faces: Faces
    n_verts: int
    stencil_size: int

    @property
    def connectivity(self) -> Connectivity:
        """All that it follows from; see `shared_field_mesh`."""
        return self.faces.tobytes(), self.n_verts, self.stencil_size

    def __reduce__(self) -> tuple[Any, ...]:
        return shared_field_mesh, self.connectivity

    @cached_property
    def neighbors(self) -> Neighbors:
        """The vertices next to each vertex."""
        return neighbors(self.faces, self.n_verts)

    @cached_property
    @staged("hierarchy")
    def hierarchy(self) -> Hierarchy:
        """All vertices in coding order, and what predicts each."""
        return hierarchy(self.neighbors, self.stencil_size)

    @property
    def is_large(self) -> bool:
        """Whether prepared weights are too many to be kept from one block for others."""
        return self.n_verts > MOST_PREPARED

    @cached_property
    def prepared(self) -> Prepared | None:
        """What the weights of blocks without a key begin with; None for a large mesh."""
        return None if self.is_large else prepared_weights(self.hierarchy, 0)

    @property
    def order(self) -> npt.NDArray[np.int32]:
        """The vertices in coding order: coarsest resolution first, level after level."""
        return self.hierarchy.order

    @cached_property
    def number(self) -> Integers:
        """Place of each vertex in coding order."""
        return inverse_permutation(self.order)

    @cached_property
    def coding_order(self) -> CodingOrder:
        """Vertices in coding order, a pass for each resolution, with context neighbors of each."""
        found = self.hierarchy
        is_last = np.diff(found.level_resolutions, append=-1) != 0
        ends = found.level_starts[1:][is_last]
        return order_of_rows(found.contexts, np.concatenate([[0], ends]).astype(np.int64))


@lru_cache(maxsize=2)
def shared_field_mesh(faces: bytes, n_verts: int, stencil_size: int) -> FieldMesh:
    """The mesh of this connectivity; the same object each time, so that work is done once."""
    triangles = np.frombuffer(faces, np.int32).reshape(-1, 3)
    return FieldMesh(triangles, n_verts, stencil_size)
