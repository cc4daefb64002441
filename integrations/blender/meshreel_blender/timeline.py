"""Convert scene frames to frames of a file, and frame rates to Blender's two numbers."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from enum import StrEnum

NTSC = 1000 / 1001
RATE_TOLERANCE = 1e-6
"""Relative tolerance; Blender stores the divisor of a frame rate as float32."""

FRAME_TOLERANCE = 1e-4
"""Positions this close to a frame are not interpolated."""


class End(StrEnum):
    """Behavior before the first and after the last frame of a file."""

    HOLD = "HOLD"
    LOOP = "LOOP"


def scene_rate(fps: float, fps_base: float) -> float:
    """Frames per second of a scene, rounded to a common rate if one is close."""
    rate = fps / fps_base
    named = (round(rate), round(rate / NTSC) * NTSC, round(rate, 2), round(rate, 3))
    near = (one for one in named if one > 0 and abs(one - rate) <= RATE_TOLERANCE * rate)
    return float(next(near, rate))


def rate_numbers(rate: float) -> tuple[int, float]:
    """Blender's `fps` and `fps_base` of a frame rate: `fps / fps_base` is the rate."""
    fps = max(1, math.ceil(rate - RATE_TOLERANCE))
    return fps, fps / rate


def scene_frames_per_reel_frame(scene_fps: float, reel_fps: float) -> float:
    """Scene frames per frame of a file; 1 if the rate of the file is unknown (0)."""
    return scene_fps / reel_fps if reel_fps else 1.0


def reel_position(
    scene_frame: float, start_frame: float, duration: float, n_frames: int, end: str
) -> float:
    """Position of a scene frame in a file, in frames: 0 to n_frames - 1.

    Parameters
    ----------
    scene_frame : float
        Scene frame including the subframe.
    start_frame : float
        Scene frame of the first frame of the file.
    duration : float
        Scene frames per frame of the file.
    n_frames : int
        Number of frames of the file.
    end : str
        One of `End`. When looping, the last frame lasts as long as the others.
    """
    position = (scene_frame - start_frame) / duration
    nearest = round(position)
    if abs(position - nearest) < FRAME_TOLERANCE:
        position = float(nearest)
    if end == End.LOOP:
        position %= n_frames
    return min(max(position, 0.0), n_frames - 1.0)


def uneven_position(seconds: float, times: Sequence[float], end: str) -> float:
    """Position in a file whose frames have times of their own, in frames: 0 to n_frames - 1.

    Parameters
    ----------
    seconds : float
        Since the first frame of the file.
    times : sequence of float
        Seconds from the first frame to each, ascending.
    end : str
        One of `End`. When looping, the last frame lasts as long as the mean of the others.
    """
    last = len(times) - 1
    if end == End.LOOP and last:
        seconds %= times[last] * (1 + 1 / last)
    before = bisect_right(times, seconds) - 1
    if before < 0 or before >= last:
        return float(min(max(before, 0), last))
    position = before + (seconds - times[before]) / (times[before + 1] - times[before])
    nearest = float(round(position))
    return nearest if abs(position - nearest) < FRAME_TOLERANCE else position


def last_scene_frame(start_frame: float, duration: float, n_frames: int) -> int:
    """Last scene frame of the range of a file."""
    return math.floor(start_frame + (n_frames - 1) * duration + FRAME_TOLERANCE)
