"""When the motion of a glTF file, which is between keys, is sampled."""

import math
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.scenes.timing import frame_times

DEFAULT_FPS = 30.0
MAX_FRAMES = 100_000
"""An hour at 24 frames per second, so that a wrong time of a key does not fill the memory."""
MAX_SPARSE_FPS = 120.0
"""Keys with gaps between them have a rate in common up to here; any have beyond, by chance."""
MIN_CURVED_FPS = 10.0
"""Fewer keys a second do not show the way between them, if it is curved."""
TOLERANCE = 1e-3
"""Share of a frame by which times may differ from a whole number of frames."""
MAX_TOLERANCE = 0.4
"""Share of a frame by which the last key may be off, where rounding of late times is coarse."""
SAME_S = 1e-5
"""Keys are the same if they differ by less."""


@dataclass(frozen=True, eq=False)
class Sampling:
    """When frames are.

    Attributes
    ----------
    times_s : float64 array of shape (T,)
        As they are told.
    exact_s : float64 array of shape (T,)
        Where curves are asked: on the keys that are where frames are but for rounding.
    fps : float
        Frames per second; 0 if there is but one.
    """

    times_s: Floats
    exact_s: Floats
    fps: float

    def first(self) -> "Sampling":
        """The first frame alone."""
        return Sampling(self.times_s[:1], self.exact_s[:1], 0.0)


STILL = Sampling(np.zeros(1), np.zeros(1), 0.0)
"""One frame, of a file in which nothing moves."""


def sample_times(keys_s: Floats, fps: float, *, is_curved: bool, notes: list[str]) -> Sampling:
    """When to sample, from the first key to the last.

    Frames are evenly spaced, and the last one shows the pose of the last key: where that is not at
    a whole number of frames, it is the first frame behind it, and a note says so.

    Parameters
    ----------
    keys_s : float64 array of shape (N,)
        Of all channels, each once, ascending; at least one.
    fps : float
        Frames per second that were asked for; 0 for the rate of the keys, or 30 if they have none.
    is_curved : bool
        Whether the way between keys may not be straight.
    notes : list of str
        Gains a sentence if the keys have no rate that suits, or the last is between two frames.

    Raises
    ------
    FormatError
        If there would be too many frames.
    """
    start, end = float(keys_s[0]), float(keys_s[-1])
    if end - start < SAME_S:
        return Sampling(keys_s[:1], keys_s[:1], 0.0)
    fps = fps or _suiting_rate(keys_s, is_curved, notes)
    n_frames = _count_frames(end - start, fps, _rounding(keys_s), notes)
    first, tolerance = start * fps, min(max(TOLERANCE, _rounding(keys_s) * fps), 0.1)
    if abs(first - round(first)) <= tolerance:
        first = round(first)
    times: Floats = (first + np.arange(n_frames, dtype=np.float64)) / fps
    exact = _on_keys(times, keys_s, tolerance / fps)
    exact[-1] = end
    return Sampling(times, exact, fps)


def common_rate(keys_s: Floats) -> float:
    """The lowest rate at which every key is at a frame, counted from the first; 0 if there is none.

    It may be up to four times as high as that of the two nearest keys.
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
    """By how many seconds times are off, for they are float32 in the file."""
    return float(np.spacing(np.float32(np.abs(keys_s).max())))


def _suiting_rate(keys_s: Floats, is_curved: bool, notes: list[str]) -> float:
    rate = common_rate(keys_s)
    if rate and (rate >= MIN_CURVED_FPS or not is_curved):
        return rate
    reason = f"{rate:g} per second and the way between is curved" if rate else "not evenly spaced"
    notes.append(
        f"keys of the animation are {reason}; sampled at {DEFAULT_FPS:g} frames per second; "
        "choose others with --fps (fps=)"
    )
    return DEFAULT_FPS


def _count_frames(span_s: float, fps: float, rounding_s: float, notes: list[str]) -> int:
    n_intervals = span_s * fps
    if n_intervals >= MAX_FRAMES:
        raise FormatError(
            f"its animation takes {span_s:g} s, which is {n_intervals:.0f} frames at {fps:g} per "
            f"second; at most {MAX_FRAMES} are read; give a lower rate with --fps (fps=)"
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


def _on_keys(times_s: Floats, keys_s: Floats, tolerance_s: float) -> Floats:
    """The times, moved to the last key that is as near as the tolerance."""
    # To the last, for a step happens at a key and not before.
    last = keys_s[np.maximum(np.searchsorted(keys_s, times_s + tolerance_s, "right") - 1, 0)]
    return np.where(np.abs(last - times_s) <= tolerance_s, last, times_s)
