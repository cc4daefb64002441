"""Motion as textures hold it: a mesh at rest, and how far its vertices are from it."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.placement import NOWHERE, Placement
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.sequence import Faces, Vertices

UP = (0.0, 1.0, 0.0)
"""The normal of a vertex that has none, since no face at it has an area."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Frames of the vertices that faces use, as offsets from the first one.

    Attributes
    ----------
    frames : float array of shape (T, V, 3)
        In model units.
    faces : int32 array of shape (M, 3)
    fps : float
        Above 0.
    placement : Placement
        Where the mesh stands in the model; its scale is 1.
    mesh_scale : float
        Units of the mesh file in a model unit.
    """

    frames: Vertices
    faces: Faces
    fps: float
    placement: Placement
    mesh_scale: float = 1.0

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return len(self.frames)

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return int(self.frames.shape[1])

    @cached_property
    def rest(self) -> npt.NDArray[np.float32]:
        """The mesh as its file has it: the first frame, in float32, of shape (V, 3)."""
        return self.positions(0).astype(np.float32)

    def positions(self, frame: int) -> npt.NDArray[np.float64]:
        """Positions of a frame around the middle of the placement, of shape (V, 3)."""
        return np.asarray(self.frames[frame].astype(np.float64) - self.placement.offset)

    def offsets(self) -> Iterator[npt.NDArray[np.float64]]:
        """How far the vertices of each frame are from the mesh at rest, of shape (V, 3)."""
        rest = self.rest.astype(np.float64)
        for frame in range(self.n_frames):
            yield self.positions(frame) - rest

    def distances(self, frame: int, offsets: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """How far vertices are off that a shader moves by these offsets, in float32, of shape (V,).

        It adds them up in the units of the mesh file.
        """
        scale = np.float32(self.mesh_scale)
        rest = (self.rest * self.mesh_scale).astype(np.float32)
        played = (rest + scale * offsets).astype(np.float64) / self.mesh_scale
        return np.asarray(np.linalg.norm(played - self.positions(frame), axis=1))

    def normals(self) -> Iterator[npt.NDArray[np.float64]]:
        """Smooth unit normals of each frame, of shape (V, 3)."""
        for frame in range(self.n_frames):
            found = vertex_normals(self.positions(frame), self.faces)
            found[~found.any(axis=1)] = UP
            yield found

    def box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The corners of the bounding box of all frames."""
        low = np.min([one.min(axis=0) for one in self.frames], axis=0).astype(np.float64)
        high = np.max([one.max(axis=0) for one in self.frames], axis=0).astype(np.float64)
        return low - self.placement.offset, high - self.placement.offset

    def offset_box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The corners of the box of all offsets."""
        boxes = [(one.min(axis=0), one.max(axis=0)) for one in self.offsets()]
        lows, highs = zip(*boxes, strict=True)
        return np.min(lows, axis=0), np.max(highs, axis=0)


def placement_for(frames: Vertices, largest_error: float, farthest: float) -> Placement:
    """Where a mesh stands: at the origin, unless float32 is too coarse as far out as it reaches.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    largest_error : float
        What may be added to each position, in model units; float32 is to add an eighth at most.
    farthest : float
        How far from the origin it may reach along an axis, in model units.
    """
    low = np.min([one.min(axis=0) for one in frames], axis=0).astype(np.float64)
    high = np.max([one.max(axis=0) for one in frames], axis=0).astype(np.float64)
    reach = float(np.maximum(-low, high).max())
    middle = ((low + high) / 2).astype(np.float32).astype(np.float64)
    is_near = np.spacing(np.float32(reach)) <= largest_error / 8 and reach <= farthest
    if is_near or not middle.any():
        return NOWHERE
    return Placement(middle, 1.0)
