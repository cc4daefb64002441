"""Axis order of position arrays: frames first or last."""

from enum import Enum

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError


class Layout(Enum):
    """Axis order of the positions of T frames and V vertices."""

    FRAMES_FIRST = "(T, V, 3)"
    FRAMES_LAST = "(V, 3, T)"  # as in registered body scans

    def sizes(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Return the number of frames and vertices of an array of the given shape."""
        return (shape[0], shape[1]) if self is Layout.FRAMES_FIRST else (shape[2], shape[0])


def has_positions(shape: tuple[int, ...] | None) -> bool:
    """Whether an array of the given shape can be positions of frames."""
    return shape is not None and len(shape) == 3 and 3 in shape[1:] and min(shape) > 0


def find_layout(
    shape: tuple[int, ...], faces: npt.NDArray[np.integer], name: str, *, is_documented: bool
) -> Layout:
    """Return the layout of an array of positions.

    The axis of size 3 decides. If two axes have size 3, the largest vertex index of the faces does:
    it must be in range, and if it is in both layouts, it should be the last vertex.

    Parameters
    ----------
    faces : integer array
    name : str
        Name of the array, for messages.
    is_documented : bool
        Whether the array has the documented name, which means (T, V, 3) if that is possible.

    Raises
    ------
    InvalidInputError
        If no axis has size 3, or both layouts fit equally well.
    """
    if not has_positions(shape):
        if len(shape) == 3 and 0 in shape[:2] and shape[2] == 3:
            return Layout.FRAMES_FIRST  # empty: the caller reports it
        raise InvalidInputError(f"{name} must have shape (T, V, 3) or (V, 3, T); got {shape}")
    axes = {Layout.FRAMES_FIRST: shape[2], Layout.FRAMES_LAST: shape[1]}
    possible = [layout for layout, size in axes.items() if size == 3]
    if len(possible) == 1:
        return possible[0]
    largest = int(faces.max()) if faces.size and faces.dtype.kind in "iu" else 0
    fitting = [layout for layout in possible if layout.sizes(shape)[1] > largest]
    if len(fitting) == 1 or (is_documented and Layout.FRAMES_FIRST in fitting):
        return fitting[0]
    ending = [layout for layout in fitting if layout.sizes(shape)[1] == largest + 1]
    if len(ending) == 1:
        return ending[0]
    raise InvalidInputError(
        f"{name} has shape {shape} and faces use vertices up to {largest}: it may be "
        "(T, V, 3) or (V, 3, T); store it as (T, V, 3) under the name vertices"
    )
