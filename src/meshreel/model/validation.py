"""Checks of the arrays and numbers that make up a sequence."""

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.model.extent import Vertices
from meshreel.runtime.counting import counted

Faces = npt.NDArray[np.int32]
AnyArray = TypeVar("AnyArray", bound=npt.NDArray[Any])


def validate_vertices(vertices: Any) -> Vertices:
    """Return an array of finite positions of shape (T, V, 3), T and V at least 1.

    Raises
    ------
    InvalidInputError
        If shape or type are wrong, or a position is not finite; the message has the first one.
    """
    array = np.asarray(vertices)
    if array.ndim != 3 or array.shape[2] != 3:
        is_frame = array.ndim == 2 and array.shape[1] == 3
        remedy = "; for a sequence of one frame, pass vertices[None]" if is_frame else ""
        raise InvalidInputError(f"vertices must have shape (T, V, 3); got {array.shape}{remedy}")
    if array.dtype not in (np.float32, np.float64):
        raise InvalidInputError(
            f"vertices must be float32 or float64; got {array.dtype}; convert with astype"
        )
    if array.shape[0] == 0:
        raise InvalidInputError("a sequence needs at least one frame; got none")
    if array.shape[1] == 0:
        raise InvalidInputError("a mesh needs at least one vertex; got none")
    validate_finite(array)
    return array


def validate_finite(vertices: Vertices, *, first_frame: int = 0) -> None:
    """Raise `InvalidInputError` with the first frame and vertex whose position is not finite.

    Parameters
    ----------
    vertices : float array of shape (T, V, 3)
    first_frame : int, default 0
        Number of the first of these frames in its sequence.
    """
    for index, frame in enumerate(vertices):
        is_finite = np.isfinite(frame)
        if not is_finite.all():
            vertex, axis = np.argwhere(~is_finite)[0]
            raise InvalidInputError(
                f"every position must be finite; vertex {vertex} of frame {first_frame + index} "
                f"has {'xyz'[axis]} = {frame[vertex, axis]}"
            )


def validate_faces(faces: Any, n_verts: int, n_frames: int = 0) -> Faces:
    """Return the faces as int32 of shape (M, 3), all indices in 0..V-1 and M at least 1.

    `n_frames` lets the error recognize positions whose first two axes are swapped.

    Raises
    ------
    InvalidInputError
        If shape or type are wrong, or a face is out of range; the message has the first one.
    """
    array = np.asarray(faces)
    if array.size == 0:
        raise InvalidInputError(
            f"a mesh needs at least one face; got {counted(n_verts, 'vertex')} without faces "
            "(point clouds are not supported)"
        )
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidInputError(f"faces must have shape (M, 3); got {array.shape}")
    if not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(f"faces must be integers; got {array.dtype}")
    if array.min() < 0 or array.max() >= n_verts:
        outside = (array < 0) | (array >= n_verts)
        row = int(np.argmax(outside.any(axis=1)))
        is_swapped = array.min() >= 0 and array.max() < n_frames
        remedy = "; if it is (V, T, 3), pass vertices.swapaxes(0, 1)" if is_swapped else ""
        raise InvalidInputError(
            f"face {row} is {array[row].tolist()}; indices must be in 0..{n_verts - 1}, "
            f"because vertices of shape (T, V, 3) have V = {n_verts}{remedy}"
        )
    return np.ascontiguousarray(array, dtype=np.int32)


def validate_fps(fps: float) -> float:
    """Return a frame rate that is finite and not negative, else raise `InvalidInputError`."""
    fps = _number(fps, "fps")
    if not (np.isfinite(fps) and fps >= 0):
        raise InvalidInputError(f"fps must be finite and at least 0 (0 = unknown); got {fps}")
    return fps


def validate_start(start_s: float) -> float:
    """Return a finite time of the first frame, else raise `InvalidInputError`."""
    start_s = _number(start_s, "start_s")
    if not np.isfinite(start_s):
        raise InvalidInputError(f"start_s must be finite; got {start_s}")
    return start_s


def _number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} must be a number; got {value!r:.60}") from None


def frozen(array: AnyArray) -> AnyArray:
    """Return a read-only array of the same values: a copy if anybody can still write the memory."""
    base: Any = array
    while isinstance(base, np.ndarray) and not base.flags.writeable:
        base = base.base
    return (hand_over(array.copy()) if isinstance(base, np.ndarray) else array).view()


def hand_over(array: AnyArray) -> AnyArray:
    """Make a new array read-only, so that `frozen` does not copy it; return it."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base.flags.writeable = False
        base = base.base
    return array


def restore(instance: object, state: dict[str, Any]) -> None:
    """Set the attributes of an unpickled object; arrays become read-only again."""
    for value in state.values():
        if isinstance(value, np.ndarray):
            hand_over(value)
    vars(instance).update(state)
