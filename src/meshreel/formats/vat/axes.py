"""The axes of programs, against those of glTF: right-handed, y upwards, metres."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats

Number = TypeVar("Number", np.float32, np.float64)


@dataclass(frozen=True)
class Axes:
    """Axes of a program: which of ours each one is, in which direction, and how long a metre is.

    Attributes
    ----------
    name : str
        As the program calls them.
    order : tuple of int
        Our axis for each of its axes.
    signs : tuple of int
        1 or -1: whether it has the same direction.
    scale : float, default 1
        Its units in one of ours.
    """

    name: str
    order: tuple[int, int, int]
    signs: tuple[int, int, int]
    scale: float = 1.0

    def turn(self, vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Our vectors, of shape (..., 3), in these axes; their lengths stay."""
        return vectors[..., list(self.order)] * np.asarray(self.signs, vectors.dtype)

    def turn_back(self, vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Vectors in these axes in ours; the inverse of `turn`."""
        ours = np.empty_like(vectors)
        ours[..., list(self.order)] = vectors * np.asarray(self.signs, vectors.dtype)
        return ours

    def turn_rotations(self, quaternions: Floats) -> Floats:
        """Our rotations as quaternions x y z w, of shape (..., 4), in these axes.

        A mirror turns them the other way around.
        """
        sense = -1 if self.is_mirrored else 1
        return np.concatenate(
            [sense * self.turn(quaternions[..., :3]), quaternions[..., 3:]], axis=-1
        )

    def turn_box(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """The corners of our box in these axes and units."""
        one, other = self.scale * self.turn(low), self.scale * self.turn(high)
        return np.minimum(one, other), np.maximum(one, other)

    @property
    def is_mirrored(self) -> bool:
        """Whether these axes are left-handed."""
        matrix = np.zeros((3, 3))
        matrix[range(3), self.order] = self.signs
        return bool(np.linalg.det(matrix) < 0)


@dataclass(frozen=True)
class MeshSpace:
    """The axes and units in which the vertices of a mesh file are, as a shader expects them.

    Attributes
    ----------
    axes : Axes
    rotation : tuple of float, optional
        The quaternion x y z w by which the node of the mesh turns them into ours; None for none.
    """

    axes: Axes
    rotation: tuple[float, float, float, float] | None = None


BLENDER = Axes("Right-Handed Z-Up", (0, 2, 1), (1, -1, 1))
GLTF = Axes("Right-Handed Y-Up", (0, 1, 2), (1, 1, 1))
UNITY = Axes("Left-Handed Y-Up", (0, 1, 2), (-1, 1, 1))
UNREAL = Axes("Left-Handed Z-Up", (0, 2, 1), (1, 1, 1), 100.0)

GLTF_SPACE = MeshSpace(GLTF)
BLENDER_FBX_SPACE = MeshSpace(replace(BLENDER, scale=0.01), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5))
"""Of the FBX files that Blender writes: hundredths, which a node turns and scales."""
