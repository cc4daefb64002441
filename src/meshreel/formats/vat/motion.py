"""The motion to bake: a rest mesh, and the offsets of its vertices in each frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.morphs import IDENTITY, Placement
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.sequence import Faces, Vertices

UP = (0.0, 1.0, 0.0)
"""Normal of a vertex without one, since all faces around it are degenerate."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Frames of the vertices that faces use, as offsets from the first frame.

    Attributes
    ----------
    frames : float array of shape (T, V, 3)
        Positions in model units.
    faces : int32 array of shape (M, 3)
    fps : float
        Above 0.
    placement : Placement
        Translation of the mesh in the model; its scale is 1.
    mesh_scale : float
        Units of the mesh file per model unit.
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
        """Rest positions in the mesh file: the first frame as float32, of shape (V, 3)."""
        return self.positions(0).astype(np.float32)

    def positions(self, frame: int) -> npt.NDArray[np.float64]:
        """Return the positions of a frame relative to the placement, of shape (V, 3)."""
        return np.asarray(self.frames[frame].astype(np.float64) - self.placement.offset)

    def offsets(self) -> Iterator[npt.NDArray[np.float64]]:
        """Yield the offsets of each frame from the rest mesh, of shape (V, 3)."""
        rest = self.rest.astype(np.float64)
        for frame in range(self.n_frames):
            yield self.positions(frame) - rest

    def playback_errors(
        self, frame: int, offsets: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.float64]:
        """Return the errors of vertices that a shader moves by offsets, of shape (V,).

        Shaders add them in float32, in the units of the mesh file.
        """
        scale = np.float32(self.mesh_scale)
        rest = (self.rest * self.mesh_scale).astype(np.float32)
        moved = (rest + scale * offsets).astype(np.float64) / self.mesh_scale
        return np.asarray(np.linalg.norm(moved - self.positions(frame), axis=1))

    def normals(self) -> Iterator[npt.NDArray[np.float64]]:
        """Yield the smooth unit normals of each frame, of shape (V, 3)."""
        for frame in range(self.n_frames):
            normals = vertex_normals(self.positions(frame), self.faces)
            normals[~normals.any(axis=1)] = UP
            yield normals

    def offset_box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the corners of the bounding box of all offsets."""
        boxes = [(offsets.min(axis=0), offsets.max(axis=0)) for offsets in self.offsets()]
        lows, highs = zip(*boxes, strict=True)
        return np.min(lows, axis=0), np.max(highs, axis=0)


def placement_for(frames: Vertices, max_error: float) -> Placement:
    """Return a placement that centers the mesh where float32 is too coarse, or else none.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    max_error : float
        Error that may be added to a position, in model units; float32 may use an eighth of it.
    """
    low = np.min([frame.min(axis=0) for frame in frames], axis=0).astype(np.float64)
    high = np.max([frame.max(axis=0) for frame in frames], axis=0).astype(np.float64)
    reach = float(np.maximum(-low, high).max())
    center = ((low + high) / 2).astype(np.float32).astype(np.float64)
    is_near = np.spacing(np.float32(reach)) <= max_error / 8
    if is_near or not center.any():
        return IDENTITY
    return Placement(center, 1.0)
