"""Rigs: skins, skeletons, keys and correctives as engines show them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes, Floats, Integers, Real, Singles
from meshreel.model.rig_keys import SHORT, BoneTrack, Shorts, compose
from meshreel.model.sequence import Faces

MAX_INFLUENCES = 4
"""Bones of a vertex."""

FULL = 255
"""Sum of the weights of a vertex."""

BYTE = 127
"""A displacement of correctives of 1 unit."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Bones in an order with parents first."""

    parents: Integers
    """int64 array of shape (B,). -1 for roots."""
    joints: Floats
    """float64 array of shape (B, 3). Position of the joint of each bone with its parent, in the
    rest pose.
    """

    @property
    def names(self) -> list[str]:
        """Names of the bones: numbered, as in "bone_07"."""
        width = len(str(len(self.parents) - 1))
        return [f"bone_{number:0{width}}" for number in range(len(self.parents))]


@dataclass(frozen=True, eq=False)
class Correctives:
    """Morph targets."""

    targets: npt.NDArray[np.int8]
    """int8 array of shape (K, V, 3). Displacements in the rest pose; 127 is 1 unit."""
    weights: Singles
    """float32 array of shape (T, K)."""

    @classmethod
    def none(cls, n_frames: int, n_verts: int) -> "Correctives":
        """Return no targets."""
        return cls(np.zeros((0, n_verts, 3), np.int8), np.zeros((n_frames, 0), np.float32))

    def nonnegative(self) -> "tuple[Singles, Correctives]":
        """Return displacements of the rest pose, in units, and the same motion from there.

        No weight is negative then: Blender 5.0 limits negative ones to 0 if that of the first frame
        is not the lowest.
        """
        lowest = np.minimum(self.weights.min(axis=0), 0)
        displacements = np.tensordot(lowest, self.targets / np.float32(BYTE), 1)
        return displacements, Correctives(self.targets, self.weights - lowest)


@dataclass(frozen=True)
class RigErrors:
    """Errors of the vertices as engines show them, over all frames.

    Attributes
    ----------
    kg_percent, largest_percent : float
        As `kg_error_percent` and `max_error_percent` of `meshreel.compare`.
    normal_deg : float
        Mean angle between face normals.
    """

    kg_percent: float
    largest_percent: float
    normal_deg: float


@dataclass(frozen=True, eq=False)
class Rig:
    """A mesh that bones move, with correctives, as it is stored in files.

    A vertex is at ``sum of w M (p + sum of c d)``: weights w and matrices M of its bones, position
    p in the rest pose, weights c and displacements d of the correctives.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
    times_s : float64 array of shape (T,)
    coordinates : int16 array of shape (V, 3)
        Positions in the rest pose; 32767 is `scale` model units.
    scale : float
    offset : float64 array of shape (3,)
        Position of coordinates 0 in the space of the skeleton.
    origin : float64 array of shape (3,)
        Position of the skeleton, float32 values.
    joints, weights : uint8 arrays of shape (V, 4)
        Bones of each vertex, and their weights, whose sum is 255.
    skeleton : Skeleton
    tracks : tuple of BoneTrack
    correctives : Correctives
        In units of `scale`.
    errors : RigErrors
    """

    faces: Faces
    times_s: Floats
    coordinates: Shorts
    scale: float
    offset: Floats
    origin: Floats
    joints: Bytes
    weights: Bytes
    skeleton: Skeleton
    tracks: tuple[BoneTrack, ...]
    correctives: Correctives
    errors: RigErrors

    @property
    def n_bones(self) -> int:
        """Number of bones."""
        return len(self.tracks)

    @property
    def n_targets(self) -> int:
        """Number of corrective morph targets."""
        return len(self.correctives.targets)

    @property
    def rest(self) -> Floats:
        """Positions in the rest pose, of shape (V, 3)."""
        return self.coordinates / SHORT * self.scale + self.offset + self.origin

    @property
    def inverse_binds(self) -> Singles:
        """Matrices from coordinates, as normalized integers, to bones: (B, 4, 4)."""
        matrices = np.zeros((self.n_bones, 4, 4), np.float32)
        matrices[:, range(3), range(3)] = self.scale
        matrices[:, :3, 3] = self.offset - self.skeleton.joints
        matrices[:, 3, 3] = 1
        return matrices

    @cached_property
    def matrices(self) -> Singles:
        """Matrices of the bones in all frames, from coordinates to model units: (T, B, 3, 4)."""
        world: list[Singles] = []
        for track, parent in zip(self.tracks, self.skeleton.parents.tolist(), strict=True):
            local = track.matrices(self.times_s)
            world.append(local if parent < 0 else compose(world[parent], local))
        return np.stack(world, axis=1) @ self.inverse_binds

    def dense_weights(self) -> Singles:
        """Return the weights of all bones, of shape (V, B)."""
        weights = self.weights.astype(np.float32) / np.float32(FULL)
        return scatter(weights, self.joints, self.n_bones)

    def blended(self) -> Singles:
        """Return the blended rotations of each vertex, in model units: (T, V, 3, 3)."""
        linear = self.matrices[..., :3].reshape(len(self.times_s), self.n_bones, 9)
        blended = self.dense_weights() @ linear / np.float32(self.scale)
        return np.asarray(blended.reshape(*blended.shape[:2], 3, 3))

    def positions(self) -> Singles:
        """Return the vertices in all frames relative to `origin`, as float32: (T, V, 3)."""
        weights, rest = self.dense_weights(), self.coordinates / np.float32(SHORT)
        targets = self.correctives.targets / np.float32(BYTE)
        frames = np.empty((len(self.times_s), *rest.shape), np.float32)
        flat = targets.reshape(self.n_targets, rest.size)
        for frame, matrices, morph in zip(
            frames, self.matrices, self.correctives.weights, strict=True
        ):
            blended = (weights @ matrices.reshape(self.n_bones, 12)).reshape(-1, 3, 4)
            points = rest + (morph @ flat).reshape(rest.shape) if self.n_targets else rest
            frame[:] = np.einsum("vab,vb->va", blended[:, :, :3], points) + blended[:, :, 3]
        return frames


def scatter(weights: Real, bones: npt.NDArray[np.integer], n_bones: int) -> Real:
    """Return the weights of all bones, of shape (V, B), from those of a few bones per vertex."""
    dense = np.zeros((len(weights), n_bones), weights.dtype)
    np.add.at(dense, (np.arange(len(weights))[:, np.newaxis], bones), weights)
    return dense
