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
