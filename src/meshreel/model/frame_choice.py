"""Selection of frames by number, slice or list."""

import operator
from collections.abc import Iterator, Sequence
from typing import Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError, Keyword, MissingFrameError

FrameChoice = SupportsIndex | slice | npt.ArrayLike

MAX_RUNS = 8
"""Maximum number of runs of frames that `frames_text` lists."""


def chosen_frames(choice: FrameChoice, n_frames: int) -> int | range | npt.NDArray[np.int64]:
    """The indices, in 0..T-1, of the frames that a choice selects; an int for a single number.

    Parameters
    ----------
    choice : int, slice, list or array
        Negative numbers count from the end. A Boolean array has an item for each frame.
    n_frames : int
        T.

    Raises
    ------
    MissingFrameError
        If a frame does not exist, an IndexError.
    TypeError
        If the choice is of another type.
    """
    if isinstance(choice, slice):
        return range(n_frames)[choice]
    if isinstance(choice, str | bytes | tuple):  # NumPy would take a tuple as frame and vertex
        raise _type_error(choice)
    if _is_number(choice):
        return frame_number(choice, n_frames)  # type: ignore[arg-type]
    try:
        numbers = np.asarray(choice)
    except ValueError:  # lists of different lengths
        raise _type_error(choice) from None
    if numbers.shape == (0,):
        return np.empty(0, np.int64)
    if numbers.dtype == bool and numbers.ndim == 1:
        if len(numbers) != n_frames:
            raise MissingFrameError(
                f"{len(numbers)} Booleans for {n_frames} frames; give one per frame"
            )
        return np.flatnonzero(numbers)
    if numbers.ndim != 1 or not np.issubdtype(numbers.dtype, np.integer):
        raise _type_error(choice)
    return _from_start(numbers, n_frames)


def frame_number(choice: SupportsIndex, n_frames: int) -> int:
    """The number, in 0..T-1, of one frame; negative numbers count from the end.

    Raises
    ------
    MissingFrameError
        If the frame does not exist, an IndexError.
    TypeError
        If the choice is not an integer.
    """
    if not _is_number(choice):
        raise TypeError(
            f"select a frame by its number, or several by a slice; got {type(choice).__name__} "
            f"{choice!r:.60}"
        )
    return int(_from_start(np.array([operator.index(choice)]), n_frames)[0])


def consecutive_runs(numbers: npt.NDArray[np.int64]) -> Iterator[tuple[int, range]]:
    """Yield runs of consecutive numbers, lowest first: the index of the first, and the range."""
    cuts = np.flatnonzero(np.diff(numbers) != 1) + 1
    starts = np.concatenate(([0], cuts, [len(numbers)]))
    for run in np.argsort(numbers[starts[:-1]], kind="stable") if len(numbers) else ():
        start, first = int(starts[run]), int(numbers[starts[run]])
        yield start, range(first, first + int(starts[run + 1]) - start)


def frames_text(numbers: Sequence[int]) -> str:
    """Ascending numbers of frames as text: "frame 4" or "frames 0-5, 8", at most a few runs."""
    runs = [run for _, run in consecutive_runs(np.array(numbers))]
    parts = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:MAX_RUNS]]
    n_more = sum(map(len, runs[MAX_RUNS:]))
    noun = "frame" if len(numbers) == 1 else "frames"
    return f"{noun} {', '.join(parts)}{f' and {n_more} more' if n_more else ''}"


def frame_range(frames: slice | None, n_frames: int) -> range:
    """The frames that a slice selects from `n_frames`; all for None.

    Raises
    ------
    InvalidInputError
        If it is not a slice of whole numbers, or selects no frame.
    """
    try:
        chosen = range(*(slice(None) if frames is None else frames).indices(n_frames))
    except (AttributeError, TypeError, ValueError):
        raise InvalidInputError(
            f"frames must be a slice such as slice(0, 10); got {frames!r:.60}; "
            "meshreel.open(path) decodes single frames and lists of frames"
        ) from None
    if not chosen:
        raise InvalidInputError(
            Keyword("frames"),
            f" {slice_text(frames)} select no frame; there are frames 0:{n_frames}",
        )
    return chosen


def slice_text(frames: slice | None) -> str:
    """A slice in Python's notation, such as 2:5 or ::2."""
    start, stop, step = (frames.start, frames.stop, frames.step) if frames else (None,) * 3
    numbers = (start, stop) if step is None else (start, stop, step)
    return ":".join("" if number is None else str(number) for number in numbers)


def evenly_spaced(n: int, n_chosen: int) -> list[int]:
    """Return `n_chosen` evenly spaced numbers of 0..n-1, or all if there are fewer."""
    n_chosen = min(n_chosen, n)
    return [(2 * part + 1) * n // (2 * n_chosen) for part in range(n_chosen)]


def spread_frames(numbers: Sequence[int], max_frames: int) -> list[int]:
    """At most this many of the frames, evenly spaced from the first to the last."""
    steps = np.linspace(0, len(numbers) - 1, min(max_frames, len(numbers))).round().astype(int)
    return [numbers[step] for step in steps]


def _is_number(choice: object) -> bool:
    if isinstance(choice, np.ndarray):
        return choice.ndim == 0 and np.issubdtype(choice.dtype, np.integer)
    return isinstance(choice, SupportsIndex) and not isinstance(choice, bool | np.bool_)


def _from_start(numbers: npt.NDArray[Any], n_frames: int) -> npt.NDArray[np.int64]:
    outside = (numbers < -n_frames) | (numbers >= n_frames)
    if outside.any():
        raise MissingFrameError(
            f"there is no frame {numbers[outside][0]}; there are {n_frames}, from 0 to "
            f"{n_frames - 1}, or from -{n_frames} to -1 from the end"
        )
    numbers = numbers.astype(np.int64)
    return np.where(numbers < 0, numbers + n_frames, numbers)


def _type_error(choice: object) -> TypeError:
    return TypeError(
        "frames must be a number, a slice, or a list or array of numbers; got "
        f"{type(choice).__name__} {choice!r:.60}"
    )
