"""World transforms of the nodes of a glTF file at given times."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.gltf.animation import Curves
from meshreel.formats.gltf.nodes import Nodes

Matrices = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """The nodes of a file, and the curves that animate some of them.

    Parameters
    ----------
    nodes : Nodes
    curves : Curves
        Empty if nothing is animated.
    """

    nodes: Nodes
    curves: Curves

    @cached_property
    def animated(self) -> frozenset[int]:
        """The nodes that are animated, or below an animated node."""
        nodes = {node for node, path in self.curves if path != "weights"}
        parents, depths = self.nodes.parents, self.nodes.depths
        for node in sorted(range(len(parents)), key=depths.__getitem__):
            if parents[node] in nodes:
                nodes.add(node)
        return frozenset(nodes)

    def world(self, nodes: Sequence[int], times_s: Floats) -> Matrices:
        """Return the world transforms of some nodes, of shape (T, N, 3, 4)."""
        transforms: dict[int, Matrices] = {}
        for node in self.nodes.with_ancestors(nodes):
            local, parent = self._local(node, times_s), self.nodes.parents[node]
            transforms[node] = local if parent < 0 else transforms[parent] @ local
        worlds = np.empty((len(times_s), len(nodes), 3, 4))
        for index, node in enumerate(nodes):
            worlds[:, index] = transforms[node][:, :3]
        return worlds

    def weights(self, node: int, default: Floats, times_s: Floats) -> Floats:
        """Return the weights of morph targets at a node, of shape (T, M)."""
        curve = self.curves.get((node, "weights"))
        return np.tile(default, (len(times_s), 1)) if curve is None else curve.at(times_s)

    def _local(self, node: int, times_s: Floats) -> Matrices:
        """Return the transforms to the parent, of shape (T, 4, 4), or (1, 4, 4) if static."""
        rest = self.nodes.transform(node)
        if rest.matrix is not None:
            return rest.matrix[np.newaxis]
        transforms = []
        for path in ("translation", "rotation", "scale"):
            curve = self.curves.get((node, path))
            transforms.append(
                getattr(rest, path)[np.newaxis] if curve is None else curve.at(times_s)
            )
        return compose(*transforms)


def compose(translations: Floats, rotations: Floats, scales: Floats) -> Matrices:
    """Return transforms that scale, then rotate, then translate, of shape (T, 4, 4).

    Parameters
    ----------
    translations, scales : float64 arrays of shape (T, 3)
    rotations : float64 array of shape (T, 4)
        Unit quaternions x y z w. Each of the three may have a single row, for all times.
    """
    n_times = max(len(translations), len(rotations), len(scales))
    transforms = np.zeros((n_times, 4, 4))
    transforms[:, :3, :3] = rotation_matrices(rotations) * scales[:, np.newaxis]
    transforms[:, :3, 3] = translations
    transforms[:, 3, 3] = 1
    return transforms


def rotation_matrices(quaternions: Floats) -> Matrices:
    """Return the matrices of unit quaternions x y z w, of shape (T, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
