"""Selection of the times at which the keyframe animation of a glTF file is sampled."""

import math
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, Keyword, Message
from meshreel.formats.scenes.timing import frame_times

DEFAULT_FPS = 30.0
MAX_FRAMES = 100_000
"""More than an hour at 24 frames per second; an invalid key time must not fill the memory."""
MAX_SPARSE_FPS = 120.0
"""Highest rate that is derived from keys with gaps; above it, any keys fit some rate by chance."""
MIN_CURVED_FPS = 10.0
"""Rate of keys below which curved motion between them must be sampled more densely."""
TOLERANCE = 1e-3
"""Deviation of times from whole frames that counts as rounding, in frames."""
MAX_TOLERANCE = 0.4
"""Limit of that deviation for the last key, where float32 is coarse, in frames."""
SAME_S = 1e-5
"""Time difference below which keys are the same."""


@dataclass(frozen=True, eq=False)
class Sampling:
    """The times of frames.

    Attributes
    ----------
    times_s : float64 array of shape (T,)
        Nominal times of the frames.
    curve_times_s : float64 array of shape (T,)
        Times at which curves are evaluated: key times that differ from frames only by rounding
        replace the nominal times.
    fps : float
        Frames per second; 0 for a single frame.
    """

    times_s: Floats
    curve_times_s: Floats
    fps: float

    def first(self) -> "Sampling":
        """Return a sampling with the first frame only."""
        return Sampling(self.times_s[:1], self.curve_times_s[:1], 0.0)


STATIC = Sampling(np.zeros(1), np.zeros(1), 0.0)
"""One frame, for a file without animation."""


def sample_times(keys_s: Floats, fps: float, *, is_curved: bool, notes: list[str]) -> Sampling:
    """Return the times of frames from the first key to the last.

    Frames are evenly spaced, and the last one shows the pose of the last key: if that is between
    two frames, it is shown by the later one, and a note says so.

    Parameters
    ----------
    keys_s : float64 array of shape (N,)
        Distinct key times of all channels, ascending; at least one.
    fps : float
        Requested frames per second; 0 for the rate of the keys, or 30 if they have none.
    is_curved : bool
        Whether motion between keys may be curved.
    notes : list of str
        Gains a sentence if the keys have no suitable rate, or the last is between two frames.

    Raises
    ------
    FormatError
        If there would be too many frames.
        If there would be too many frames.
    """
    start, end = float(keys_s[0]), float(keys_s[-1])
    if end - start < SAME_S:
        return Sampling(keys_s[:1], keys_s[:1], 0.0)
    fps = fps or _choose_rate(keys_s, is_curved, notes)
    n_frames = _count_frames(end - start, fps, _rounding(keys_s), notes)
    first, tolerance = start * fps, min(max(TOLERANCE, _rounding(keys_s) * fps), 0.1)
    if abs(first - round(first)) <= tolerance:
        first = round(first)
    times: Floats = (first + np.arange(n_frames, dtype=np.float64)) / fps
    curve_times = _snap_to_keys(times, keys_s, tolerance / fps)
    curve_times[-1] = end
    return Sampling(times, curve_times, fps)


def common_rate(keys_s: Floats) -> float:
    """Return the lowest frame rate at which every key is on a frame; 0 if there is none.

    Frames count from the first key. The rate is at most four times that of the closest keys.
    """
    distinct = keys_s[np.diff(keys_s, prepend=-np.inf) > SAME_S]
    if len(distinct) < 2:
        return 0.0
    span = float(distinct[-1] - distinct[0])
    rate = 1 / float(np.diff(distinct).min())
    for multiple in (1, 2, 3, 4):
        n_intervals = round(span * rate * multiple)
        if n_intervals >= MAX_FRAMES:
            return 0.0
        grid = np.linspace(distinct[0], distinct[-1], n_intervals + 1)
        fps = frame_times(grid).fps
        is_full = n_intervals + 1 == len(distinct)
        if (is_full or fps <= MAX_SPARSE_FPS) and _is_on_grid(distinct, fps):
            return fps
    return 0.0


def _is_on_grid(keys_s: Floats, fps: float) -> bool:
    frames, tolerance = (keys_s - keys_s[0]) * fps, max(10 * TOLERANCE, 2 * _rounding(keys_s) * fps)
    return bool(np.abs(frames - np.round(frames)).max() <= tolerance)


def _rounding(keys_s: Floats) -> float:
    """Return the float32 resolution of the key times, in seconds."""
    return float(np.spacing(np.float32(np.abs(keys_s).max())))


def _choose_rate(keys_s: Floats, is_curved: bool, notes: list[str]) -> float:
    rate = common_rate(keys_s)
    if rate and (rate >= MIN_CURVED_FPS or not is_curved):
        return rate
    reason = (
        f"at {rate:g} per second with curved motion between them" if rate else "not evenly spaced"
    )
    notes.append(
        Message(
            f"keys of the animation are {reason}; sampled at {DEFAULT_FPS:g} frames per second; "
            "choose another rate with ",
            Keyword("fps"),
        )
    )
    return DEFAULT_FPS


def _count_frames(span_s: float, fps: float, rounding_s: float, notes: list[str]) -> int:
    n_intervals = span_s * fps
    if n_intervals >= MAX_FRAMES:
        raise FormatError(
            f"its animation takes {span_s:g} s, which is {n_intervals:.0f} frames at {fps:g} per "
            f"second; the limit is {MAX_FRAMES}; choose a lower rate with ",
            Keyword("fps"),
        )
    nearest = round(n_intervals)
    tolerance = min(max(TOLERANCE, n_intervals * 1e-6, rounding_s * fps), MAX_TOLERANCE)
    is_whole = nearest > 0 and abs(n_intervals - nearest) <= tolerance
    if is_whole:
        return nearest + 1
    n_covering = math.ceil(n_intervals)
    notes.append(
        f"the animation takes {span_s:.6g} s, which is {n_intervals:.4g} frames at {fps:g} per "
        f"second; the last frame, {n_covering / fps:.6g} s after the first, shows its final pose"
    )
    return n_covering + 1


def _snap_to_keys(times_s: Floats, keys_s: Floats, tolerance_s: float) -> Floats:
    """Return the times, moved to the last key within the tolerance."""
    # The last one, since steps take effect at their key.
    last = keys_s[np.maximum(np.searchsorted(keys_s, times_s + tolerance_s, "right") - 1, 0)]
    return np.where(np.abs(last - times_s) <= tolerance_s, last, times_s)
