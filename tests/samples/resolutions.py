"""The hierarchy of the core, arranged by resolutions."""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Integers
from meshreel.kernel.mesh import Hierarchy


@dataclass(frozen=True)
class Resolution:
    """A graph of some vertices: those of coarser resolutions, and the ones that it adds.

    Attributes
    ----------
    members : integer array of shape (N,)
        Vertices of the graph, ascending.
    levels : list of integer arrays
        The added vertices; those of a level are predicted together.
    stencil : integer array of shape (n, S)
        Nearest vertices of earlier levels and coarser resolutions for each added vertex, level by
        level; nearest first, padded with -1.
    hops : integer array of shape (n, S)
        Their distances, in edges of the graph; padded with 0.
    """

    members: Integers
    levels: list[Integers]
    stencil: Integers
    hops: Integers

    @property
    def predicted(self) -> Integers:
        """Vertices of all levels, in order."""
        return np.concatenate(self.levels)


def core_resolutions(hierarchy: Hierarchy) -> list[Resolution]:
    """Return the resolutions of a hierarchy, from the coarsest to the mesh itself."""
    starts, number_of = hierarchy.level_starts, hierarchy.level_resolutions
    order, stencil = hierarchy.order.astype(np.int64), hierarchy.stencil.astype(np.int64)
    stencil = np.where(stencil >= 0, order[stencil], -1)
    hops = hierarchy.hops.astype(np.int64)
    resolutions = []
    for number in range(int(number_of[-1]) + 1):
        first, last = np.searchsorted(number_of, (number, number + 1))
        rows = slice(starts[first], starts[last])
        levels = np.split(order[rows], starts[first + 1 : last] - starts[first])
        members = np.sort(order[: rows.stop])
        resolutions.append(Resolution(members, levels, stencil[rows], hops[rows]))
    return resolutions
