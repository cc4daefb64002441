"""The frames that a number, a slice or a list chooses, and when the first of them is."""

import operator
from typing import Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError

FrameChoice = SupportsIndex | slice | npt.ArrayLike


def chosen_frames(chosen: FrameChoice, n_frames: int) -> int | range | npt.NDArray[np.int64]:
    """The index of one frame, or those of several, all in 0..T-1.

    Parameters
    ----------
    chosen : int, slice, list or array
        Negative numbers count from the end. A Boolean array marks the frames that are chosen.
    n_frames : int
        T.

    Raises
    ------
    IndexError
        If there is no such frame.
    TypeError
        If it is of another type.
    """
    if isinstance(chosen, slice):
        return range(n_frames)[chosen]
    if isinstance(chosen, str | bytes | tuple):  # a tuple would mean vertices of frames in NumPy
        raise _type_error(chosen)
    if _is_number(chosen):
        return int(_counted_from_start(np.array([operator.index(chosen)]), n_frames)[0])  # type: ignore[arg-type]
    try:
        numbers = np.asarray(chosen)
    except ValueError:  # lists of several lengths
        raise _type_error(chosen) from None
    if numbers.shape == (0,):
        return np.empty(0, np.int64)
    if numbers.dtype == bool and numbers.ndim == 1:
        if len(numbers) != n_frames:
            raise IndexError(f"{len(numbers)} choices of {n_frames} frames; give one for each")
        return np.flatnonzero(numbers)
    if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
        raise _type_error(chosen)
    return _counted_from_start(numbers, n_frames)


def frame_range(frames: slice | None, n_frames: int) -> range:
    """The frames of so many that a slice names; None names all.

    Raises
    ------
    InvalidInputError
        If it names no frame, or has a step.
    """
    start, stop, step = (frames or slice(None)).indices(n_frames)
    if step != 1:
        raise InvalidInputError(f"frames must have no step; got {frames}")
    if start >= stop:
        raise InvalidInputError(
            f"frames {slice_text(frames)} name no frame; there are frames 0:{n_frames}"
        )
    return range(start, stop)


def start_of(wanted: range, start_s: float, fps: float) -> float:
    """Time of the first of the wanted frames, in seconds, if the frame rate is known."""
    return start_s + (wanted.start / fps if fps else 0.0)


def slice_text(frames: slice | None) -> str:
    """A slice without a step as Python writes it, such as 2:5."""
    start, stop = (frames.start, frames.stop) if frames else (None, None)
    return ":".join("" if end is None else str(end) for end in (start, stop))


def _is_number(chosen: object) -> bool:
    if isinstance(chosen, np.ndarray):
        return chosen.ndim == 0 and np.issubdtype(chosen.dtype, np.integer)
    return isinstance(chosen, SupportsIndex) and not isinstance(chosen, bool | np.bool_)


def _counted_from_start(numbers: npt.NDArray[Any], n_frames: int) -> npt.NDArray[np.int64]:
    outside = (numbers < -n_frames) | (numbers >= n_frames)
    if outside.any():
        raise IndexError(
            f"there is no frame {numbers[outside][0]}; there are {n_frames}, from 0 to "
            f"{n_frames - 1}, or from -{n_frames} to -1 counted from the end"
        )
    numbers = numbers.astype(np.int64)
    return np.where(numbers < 0, numbers + n_frames, numbers)


def _type_error(chosen: object) -> TypeError:
    return TypeError(
        "frames are chosen by a number, a slice, or a list or array of numbers; got "
        f"{type(chosen).__name__} {chosen!r:.60}"
    )
