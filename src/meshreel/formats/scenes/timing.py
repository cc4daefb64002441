"""Frame times of files: union, order, and interpolation between frames."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers, Values
from meshreel.errors import FormatError, Keyword
from meshreel.formats.options import Reading
from meshreel.model.validation import validate_fps

MAX_FRAMES = 1_000_000
"""More than nine hours at 30 frames per second; a wrong count must not fill the memory."""


def unite_times(times: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Return the union of ascending times; those of static meshes are ignored if any moves.

    Times that differ by less than a thousandth of the shortest interval are merged.
    """
    moving = [time for time in times if len(time) > 1]
    if not moving:
        return np.asarray(times[0][:1], np.float64)
    all_times = np.sort(np.concatenate(moving))
    min_gap = min(float(np.diff(mesh_times).min()) for mesh_times in moving) / 1000
    distinct: npt.NDArray[np.float64] = all_times[np.diff(all_times, prepend=-np.inf) > min_gap]
    return distinct


def file_order_times(n_frames: int, reading: Reading) -> Floats | None:
    """Return times of frames in file order, of shape (T,), in seconds from 0.

    The frame rate is that of the options, and a note reports it; None without a rate.
    """
    if not (fps := validate_fps(reading.fps or 0.0)):
        return None
    text = f"frame times are not ascending; read in file order at {fps:g} frames per second"
    reading.notes.changed("frame times", text)
    times: Floats = np.arange(n_frames, dtype=np.float64) / fps
    return times


def ascending_times(times_s: Floats, noun: str, reading: Reading) -> Floats:
    """Return times if they ascend, else those of `file_order_times`.

    Parameters
    ----------
    times_s : float64 array of shape (T,)
    noun : str
        What the file calls a frame, for the message.

    Raises
    ------
    FormatError
        If they do not ascend, and the options have no frame rate.
    """
    if not len(descents := np.flatnonzero(np.diff(times_s) <= 0)):
        return times_s
    if (times := file_order_times(len(times_s), reading)) is not None:
        return times
    index = int(descents[0])
    raise FormatError(
        f"has {noun} {index} at time {times_s[index]:g} and {noun} {index + 1} at "
        f"{times_s[index + 1]:g}; times must ascend; read the {noun}s in file order with ",
        Keyword("fps"),
    )


class Neighbors(NamedTuple):
    """The frames at or around a time."""

    before: int
    after: int
    """Frame numbers; equal if the time is at a frame, before the first or after the last."""
    share: float = 0.0
    """Fraction of the way from `before` to `after`."""


def neighbors(times_s: npt.NDArray[np.float64], time_s: float) -> Neighbors:
    """Return the frames at or around a time, given ascending frame times.

    The time is at a frame if it is nearer than a thousandth of the interval.
    """
    after = int(np.searchsorted(times_s, time_s))
    if after == 0 or after == len(times_s):
        nearest = min(after, len(times_s) - 1)
        return Neighbors(nearest, nearest)
    before, interval = after - 1, times_s[after] - times_s[after - 1]
    share = float((time_s - times_s[before]) / interval)
    if share > 0.999:
        return Neighbors(after, after)
    if share < 0.001:
        return Neighbors(before, before)
    return Neighbors(before, after, share)


Intervals = tuple[Integers, Integers, Floats]
"""`Neighbors` of several times, as arrays of shape (T,)."""


def neighbors_of_times(times_s: Floats, requested_s: Floats) -> Intervals:
    """Return the `neighbors` of at least one time as arrays of shape (T,)."""
    intervals = [neighbors(times_s, time) for time in requested_s.tolist()]
    before, after, shares = map(np.array, zip(*intervals, strict=True))
    return before, after, shares


def blend(before: Values, after: Values, share: float | Floats) -> Values:
    """Interpolate linearly between two frames, in float64; keeps the type of the first."""
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        blended = (1 - share) * before.astype(np.float64) + share * after
        values: Values = blended.astype(before.dtype)
    return values
