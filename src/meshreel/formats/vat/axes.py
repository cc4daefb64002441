"""Axes of Blender (z up) and of glTF (y up), and the spaces of mesh files."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Number = TypeVar("Number", np.float32, np.float64)


def to_blender(vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
    """Return vectors of shape (..., 3), from glTF's axes to Blender's."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def from_blender(vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
    """Return vectors of shape (..., 3), from Blender's axes to glTF's."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([x, z, -y], axis=-1)


@dataclass(frozen=True)
class MeshSpace:
    """The axes and units of the vertices in a mesh file, as the shader expects them.

    Attributes
    ----------
    scale : float, default 1
        Units of the file per glTF unit.
    rotation : tuple of float, optional
        The quaternion x y z w of the node, which rotates vertices in Blender's axes to those of
        glTF; None if they are in glTF's axes.
    """

    scale: float = 1.0
    rotation: tuple[float, float, float, float] | None = None


GLTF_SPACE = MeshSpace()
BLENDER_FBX_SPACE = MeshSpace(0.01, (-(0.5**0.5), 0.0, 0.0, 0.5**0.5))
"""The space of FBX files from Blender: centimeters and z up, corrected by rotation and scale of the
node."""
