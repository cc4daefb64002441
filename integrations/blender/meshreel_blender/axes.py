"""Conversion of up axes: z in Blender, y in most files."""

from enum import StrEnum
from math import pi

import numpy as np
import numpy.typing as npt


class Up(StrEnum):
    """Up axis of a file."""

    Y = "Y"
    Z = "Z"


UP_ITEMS = (
    (Up.Y.value, "Y Up", "As in most files of animated meshes"),
    (Up.Z.value, "Z Up", "As in Blender"),
)


def rotation_from_file(up: str) -> tuple[float, float, float]:
    """Euler angles that rotate the up axis of a file to that of Blender."""
    return (pi / 2, 0.0, 0.0) if up == Up.Y else (0.0, 0.0, 0.0)


def matrix_to_file(up: str) -> npt.NDArray[np.float64]:
    """Exact rotation matrix (3, 3) from Blender's axes to those of a file."""
    if up == Up.Y:
        return np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return np.eye(3)
