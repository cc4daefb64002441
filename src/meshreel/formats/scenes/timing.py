"""Times of frames to a frame rate and a start, and back."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

NTSC = 1000 / 1001
"""Film and video rates of NTSC are a whole number times this: 23.976, 29.97, 59.94."""

RATE_TOLERANCE = 2e-6
"""Relative; 29.97 and 30000/1001, which files both mean as written, differ by less: 1e-6."""


@dataclass(frozen=True)
class FrameTimes:
    """When frames are.

    Attributes
    ----------
    fps : float
        Frames per second, 0 if there is only one.
    start_s : float
        Time of the first, in seconds.
    is_even : bool
        Whether all are equally far apart.
    """

    fps: float
    start_s: float
    is_even: bool


def frame_times(times_s: npt.NDArray[np.floating]) -> FrameTimes:
    """Frame rate and start of ascending times in seconds, of shape (T,).

    Rates are those that people use where the times agree with one: whole numbers, those of NTSC,
    and decimals of up to three places. Uneven times give their mean rate.
    """
    times = np.asarray(times_s, np.float64)
    if len(times) < 2 or times[-1] <= times[0]:
        return FrameTimes(0.0, float(times[0]), is_even=True)
    rate = (len(times) - 1) / (times[-1] - times[0])
    # Times stored as float32 are off by half a unit in their last place.
    coarse = float(np.spacing(np.float32(np.abs(times).max())))
    tolerance = max(RATE_TOLERANCE, coarse / (times[-1] - times[0]))
    named = (round(rate), round(rate / NTSC) * NTSC, round(rate, 2), round(rate, 3))
    near = [one for one in named if one > 0 and abs(one - rate) <= tolerance * rate]
    exact = [one for one in near if abs(one - rate) <= 1e-12 * rate]
    fps = float((exact or near or [rate])[0])
    expected = times[0] + np.arange(len(times)) / fps
    is_even = bool(np.abs(times - expected).max() <= max(1e-3 / fps, 2 * coarse))
    return FrameTimes(fps, float(times[0]), is_even)


def file_order_times(n_frames: int, fps: float) -> npt.NDArray[np.float64]:
    """Times of frames at a rate, of shape (T,), in seconds; the first is at 0."""
    times: npt.NDArray[np.float64] = np.arange(n_frames, dtype=np.float64) / fps
    return times


def note_file_order(fps: float, notes: list[str]) -> None:
    """Add to the notes, once, that frames are in file order because their times do not ascend."""
    note = f"times of frames do not ascend; taken in file order at {fps:g} frames per second"
    if note not in notes:
        notes.append(note)


@dataclass(frozen=True)
class Neighbours:
    """The frames that a time is at or between.

    Attributes
    ----------
    before, after : int
        Numbers of frames; the same if the time is at one, before the first or behind the last.
    share : float
        How much of the way from the one to the other the time is.
    """

    before: int
    after: int
    share: float = 0.0

    def shifted(self, by: int) -> "Neighbours":
        """The same frames, counted from another one."""
        return Neighbours(self.before + by, self.after + by, self.share)


def neighbours(times_s: npt.NDArray[np.float64], time_s: float) -> Neighbours:
    """The frames at ascending times that a time is at or between.

    It is at one if it is nearer than a thousandth of the interval.
    """
    after = int(np.searchsorted(times_s, time_s))
    if after == 0 or after == len(times_s):
        nearest = min(after, len(times_s) - 1)
        return Neighbours(nearest, nearest)
    before, interval = after - 1, times_s[after] - times_s[after - 1]
    share = float((time_s - times_s[before]) / interval)
    if share > 0.999:
        return Neighbours(after, after)
    if share < 0.001:
        return Neighbours(before, before)
    return Neighbours(before, after, share)
