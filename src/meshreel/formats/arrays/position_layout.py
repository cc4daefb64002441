"""Which axis of an array of positions is which."""

from enum import Enum

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError


class Layout(Enum):
    """The axes of an array of positions of T frames and V vertices."""

    FRAMES_FIRST = "(T, V, 3)"
    FRAMES_LAST = "(V, 3, T)"  # as in registered body scans

    def sizes(self, shape: tuple[int, ...]) -> tuple[int, int]:
        """Frames and vertices of an array of that shape."""
        return (shape[0], shape[1]) if self is Layout.FRAMES_FIRST else (shape[2], shape[0])


def has_positions(shape: tuple[int, ...] | None) -> bool:
    """Whether an array of that shape can hold the positions of frames."""
    return shape is not None and len(shape) == 3 and 3 in shape[1:] and min(shape) > 0


def find_layout(
    shape: tuple[int, ...], faces: npt.NDArray[np.integer], name: str, *, is_documented: bool
) -> Layout:
    """The layout of an array of positions.

    The axis of three tells. If two have three, the largest vertex that a face names decides: it
    must be there, and if it is in both layouts, it should be the last.

    Parameters
    ----------
    faces : integer array
    name : str
        Of the array, for messages.
    is_documented : bool
        Whether the array is called as those that are (T, V, 3), which it is then if it can.

    Raises
    ------
    InvalidInputError
        If no axis has three, or both layouts fit equally well.
    """
    if not has_positions(shape):
        if len(shape) == 3 and 0 in shape[:2] and shape[2] == 3:
            return Layout.FRAMES_FIRST  # that it is empty is said later
        raise InvalidInputError(
            f"{name} must have shape (T, V, 3); got {shape} ((V, 3, T) is read too)"
        )
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
        f"{name} has shape {shape} and faces name vertices up to {largest}: that may be "
        "(T, V, 3) or (V, 3, T); store it as (T, V, 3), called vertices"
    )
