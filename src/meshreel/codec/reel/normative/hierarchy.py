"""A multiresolution hierarchy: the vertices of a mesh in levels, each near those of earlier ones.

The core derives it from connectivity, in integers: encoder and decoder find the same levels and
stencils on every machine.
"""

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
        The vertices that it adds, those that are predicted at once together.
    stencil : integer array of shape (n, S)
        For each vertex of the levels, one after another, the nearest vertices of earlier levels
        and coarser resolutions, nearest first; -1 where there are no more within reach.
    hops : integer array of shape (n, S)
        How many edges of the graph away they are; 0 where there are no more.
    """

    members: Integers
    levels: list[Integers]
    stencil: Integers
    hops: Integers

    @property
    def predicted(self) -> Integers:
        """All vertices of the levels, level after level."""
        return np.concatenate(self.levels)


def resolutions_of(hierarchy: Hierarchy) -> list[Resolution]:
    """The resolutions of a hierarchy, from the coarsest to the mesh itself."""
    starts, number_of = hierarchy.level_starts, hierarchy.level_resolutions
    order, stencil = hierarchy.order.astype(np.int64), hierarchy.stencil.astype(np.int64)
    stencil = np.where(stencil >= 0, order[stencil], -1)
    hops = hierarchy.hops.astype(np.int64)
    found = []
    for number in range(int(number_of[-1]) + 1):
        first, last = np.searchsorted(number_of, (number, number + 1))
        rows = slice(starts[first], starts[last])
        levels = np.split(order[rows], starts[first + 1 : last] - starts[first])
        found.append(Resolution(np.sort(order[: rows.stop]), levels, stencil[rows], hops[rows]))
    return found
