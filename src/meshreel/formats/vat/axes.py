"""Coordinate axes of programs, relative to those of glTF: right-handed, y up, meters."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats

Number = TypeVar("Number", np.float32, np.float64)


@dataclass(frozen=True)
class Axes:
    """Coordinate axes and units of a program, relative to glTF.

    Attributes
    ----------
    order : tuple of int
        The glTF axis of each program axis.
    signs : tuple of int
        1, or -1 if the program axis points in the opposite direction.
    scale : float, default 1
        Program units per glTF unit.
    """

    order: tuple[int, int, int]
    signs: tuple[int, int, int]
    scale: float = 1.0

    def convert(self, vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Return vectors of shape (..., 3), from glTF to program axes; lengths do not change."""
        return vectors[..., list(self.order)] * np.asarray(self.signs, vectors.dtype)

    def convert_back(self, vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Return vectors of shape (..., 3), from program to glTF axes: the inverse of `convert`."""
        converted = np.empty_like(vectors)
        converted[..., list(self.order)] = vectors * np.asarray(self.signs, vectors.dtype)
        return converted

    def convert_box(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Return the corners of a box, from glTF to program axes; lengths do not change."""
        first, second = self.convert(low), self.convert(high)
        return np.minimum(first, second), np.maximum(first, second)


@dataclass(frozen=True)
class MeshSpace:
    """The axes and units of the vertices in a mesh file, as the shader expects them.

    Attributes
    ----------
    rotation : tuple of float, optional
        The quaternion x y z w of the node, which rotates the vertices to glTF axes, if any.
    """

    axes: Axes
    rotation: tuple[float, float, float, float] | None = None


BLENDER = Axes((0, 2, 1), (1, -1, 1))

GLTF_SPACE = MeshSpace(Axes((0, 1, 2), (1, 1, 1)))
BLENDER_FBX_SPACE = MeshSpace(replace(BLENDER, scale=0.01), (-(0.5**0.5), 0.0, 0.0, 0.5**0.5))
"""The space of FBX files from Blender: centimeters and z up, corrected by rotation and scale of the
node."""
