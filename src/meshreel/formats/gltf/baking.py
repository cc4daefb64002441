"""A glTF mesh at a node, as it moves: its frames, each computed when it is asked for."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.gltf.geometry import Geometry
from meshreel.formats.gltf.interpolation import Floats
from meshreel.formats.gltf.motion import Matrices, Motion
from meshreel.formats.gltf.skinning import Skin, move
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.surface import Surface

POSE_BYTES = 1 << 24
"""Transforms of nodes are computed for as many frames at once as take about this much memory."""


@dataclass(frozen=True, eq=False)
class BakedMesh:
    """A mesh at a node, in the world.

    Parameters
    ----------
    node : int
    skin : Skin, optional
        The joints that the mesh follows, in place of the node.
    weights : float64 array of shape (M,)
        Of the morph targets, while nothing moves them.
    motion : Motion
    times_s : float64 array of shape (T,)
        When frames are.
    read : function
        Gives the mesh at rest.
    """

    node: int
    skin: Skin | None
    weights: Floats
    motion: Motion
    times_s: Floats
    read: Callable[[], Geometry]
    _poses: dict[int, tuple[Matrices, Floats]] = field(default_factory=dict)

    def frame(self, index: int) -> PolygonMesh:
        """The mesh at a frame; float32, as positions of glTF are."""
        faces = self._faces
        with np.errstate(over="ignore", invalid="ignore"):  # positions are checked when all is done
            transforms, weights = self._pose(index)
            positions = self._geometry.morphed(weights)
            if self._geometry.influences is not None and self.skin is not None:
                moved = move(positions, self._geometry.influences.blend(transforms))
            else:
                moved = move(positions, transforms[0])
            return PolygonMesh(moved.astype(np.float32), faces.counts, faces.corners)

    def surface(self, index: int) -> Surface:
        """The surface of the mesh, in any frame."""
        return self._geometry.surface

    @cached_property
    def _geometry(self) -> Geometry:
        found = self.read()
        if self.skin is None:
            transforms, _ = self._pose(0)
            return found.mirrored() if np.linalg.det(transforms[0, :, :3]) < 0 else found
        n_joints = len(self.skin.joints)
        if found.influences is not None and found.influences.joints.max() >= n_joints:
            raise FormatError(
                f"node {self.node}: its mesh names joint {found.influences.joints.max()}; "
                f"its skin has {n_joints}"
            )
        return found

    @cached_property
    def _faces(self) -> PolygonMesh:
        geometry = self._geometry
        counts = np.full(len(geometry.faces), 3, np.int64)
        return polygon_mesh(geometry.positions, counts, geometry.faces.ravel())

    def _pose(self, index: int) -> tuple[Matrices, Floats]:
        """Transforms of the joints, or of the node, of shape (N, 3, 4), and weights of targets."""
        chunk, row = divmod(index, self._frames_at_once)
        if chunk not in self._poses:
            self._poses.clear()
            self._poses[chunk] = self._computed(chunk * self._frames_at_once)
        transforms, weights = self._poses[chunk]
        return transforms[row], weights[row]

    def _computed(self, start: int) -> tuple[Matrices, Floats]:
        times = self.times_s[start : start + self._frames_at_once]
        weights = self.motion.weights(self.node, self.weights, times)
        if self.skin is None:
            return self.motion.world([self.node], times), weights
        return self.motion.world(self.skin.joints, times) @ self.skin.inverse_binds, weights

    @cached_property
    def _frames_at_once(self) -> int:
        carriers = [self.node] if self.skin is None else self.skin.joints
        n_nodes = len(carriers) + len(self.motion.nodes.family(carriers))
        size_bytes = 8 * (16 * n_nodes + len(self.weights))
        return max(1, min(len(self.times_s), POSE_BYTES // size_bytes))
