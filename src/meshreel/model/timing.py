"""When frames are shown: at a frame rate, or at times of their own."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.validation import restore, validate_fps, validate_start

NTSC = 1000 / 1001
"""NTSC frame rates are integers times this: 23.976, 29.97, 59.94."""

RATE_TOLERANCE = 2e-6
"""Relative tolerance of a frame rate: above 1e-6, the difference between 29.97 and 30000/1001."""

DUE_TOLERANCE = 1e-6
"""How early frames at a rate are due, in intervals, because times have rounding errors."""


@dataclass(frozen=True, eq=False)
class Timing:
    """When the frames of a sequence are shown."""

    fps: float = 0.0
    """Frames per second, the mean rate if `times` are given; 0 = unknown."""
    start_s: float = 0.0
    """Time of the first frame, in seconds."""
    times: Floats | None = None
    """float64 array of shape (T,), or None. Time of each frame in seconds, ascending, if the frames
    are not evenly spaced.
    """
    __setstate__ = restore

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Timing):
            return NotImplemented
        is_same = (self.fps, self.start_s) == (other.fps, other.start_s)
        return is_same and np.array_equal(self.times, other.times)  # type: ignore[arg-type]

    def __hash__(self) -> int:
        return hash((self.fps, self.start_s))

    @classmethod
    def of_rate(cls, fps: float, start_s: float = 0.0) -> "Timing":
        """Return the timing of evenly spaced frames.

        Raises
        ------
        InvalidInputError
            If the rate is negative or not finite, or the start is not finite.
        """
        return cls(validate_fps(fps), validate_start(start_s))

    @classmethod
    def of_times(
        cls,
        times_s: Sequence[float] | Floats,
        n_frames: int | None = None,
        *,
        declared_fps: float = 0.0,
    ) -> "Timing":
        """Return the timing of frames at these times in seconds, ascending, of shape (T,).

        The timing is a rate if each time is within an ulp of the last one, float32 for an array of
        that type, of its even time. The rate is rounded to a common one that agrees with the times:
        an integer, an NTSC rate, or a decimal with up to three places. A single time has no rate.

        Parameters
        ----------
        n_frames : int, optional
            Expected number of times.
        declared_fps : float
            The rate, if the file states one and the times agree with it within `DUE_TOLERANCE`.

        Raises
        ------
        InvalidInputError
            If there are not `n_frames` times, or they are not finite and ascending.
        """
        times = _checked(times_s, n_frames)
        if len(times) == 1:
            return cls(declared_fps, float(times[0]))
        timing = cls._uneven(times)
        if not timing.fps:
            return timing
        is_single = isinstance(times_s, np.ndarray) and times_s.dtype in ("<f4", ">f4")
        last = np.array(np.abs(times).max(), np.float32 if is_single else np.float64)
        ulp, span = float(np.spacing(last)), float(times[-1] - times[0])
        common = rounded_rate(timing.fps, max(RATE_TOLERANCE, ulp / span))
        declared = [(declared_fps, DUE_TOLERANCE / declared_fps)] if declared_fps else []
        for fps, limit in (*declared, (common, ulp), (timing.fps, ulp)):
            if (np.abs(times - (times[0] + np.arange(len(times)) / fps)) <= limit).all():
                return cls(fps, timing.start_s)
        return timing

    @classmethod
    def _uneven(cls, times: Floats) -> "Timing":
        """Return the timing of uneven times; its mean rate is unknown if it is not finite."""
        with np.errstate(all="ignore"):
            rate = float((len(times) - 1) / (times[-1] - times[0])) if len(times) > 1 else 0.0
        times = times.copy()
        times.flags.writeable = False
        return cls(rate if np.isfinite(rate) else 0.0, float(times[0]), times)

    @classmethod
    def joined(cls, timings: Sequence["Timing"], counts: Sequence[int]) -> "Timing":
        """Return the timing of several sequences in order, of these numbers of frames.

        All frames keep their times if each sequence begins after the last frame of the one before.
        Otherwise all must have the same rate, and follow the first sequence regardless of their own
        start.

        Raises
        ------
        InvalidInputError
            If the times do not ascend, or the rates differ.
        """
        first, rates = timings[0], sorted({timing.fps for timing in timings})
        has_times = any(timing.times is not None for timing in timings)
        if not has_times and len(rates) == 1:
            starts = np.array([timing.start_s for timing in timings])
            expected = [first.at(number) for number in accumulate(counts[:-1], initial=0)]
            if (np.abs(starts - expected) <= 4 * np.spacing(np.abs(starts).max())).all():
                return first
        seconds = [timing.seconds(n) for timing, n in zip(timings, counts, strict=True)]
        known = [part for part in seconds if part is not None]
        if has_times and len(known) < len(seconds):
            raise InvalidInputError(
                "some frames have times and others no frame rate; give all of them times"
            )
        continues = all(after[0] > before[-1] for before, after in pairwise(known))
        if has_times or (continues and len(known) == len(seconds)):
            return cls.of_times(np.concatenate(known))
        if len(rates) > 1:
            raise InvalidInputError(
                f"segments have {' and '.join(f'{rate:g}' for rate in rates)} frames per second; "
                "give them the same fps"
            )
        return first

    def check(self, n_frames: int) -> None:
        """Raise InvalidInputError if there is not one time per frame."""
        if self.times is not None and len(self.times) != n_frames:
            raise InvalidInputError(
                f"times must have shape ({n_frames},), one per frame; got {self.times.shape}"
            )

    def seconds(self, n_frames: int) -> Floats | None:
        """Times of the first frames, in seconds, of shape (n,); None if the rate is unknown."""
        if self.times is not None:
            return self.times[:n_frames]
        if not self.fps and n_frames > 1:
            return None
        return self.start_s + np.arange(n_frames) / (self.fps or 1.0)

    @property
    def uneven_times(self) -> tuple[float, ...] | None:
        """Times of unevenly spaced frames, in seconds, as plain numbers; None for a rate."""
        return None if self.times is None else tuple(self.times.tolist())

    def at(self, frame: int) -> float:
        """Time of a frame, in seconds; the start if the rate is unknown."""
        if self.times is not None:
            return float(self.times[frame])
        return self.start_s + (frame / self.fps if self.fps else 0.0)

    def frame_at(self, time_s: float, n_frames: int) -> int:
        """The frame that is shown at a time, the last one that is due, else 0."""
        if self.times is not None:
            due = float(np.searchsorted(self.times, time_s, side="right")) - 1
        else:
            due = (time_s - self.start_s) * self.fps + DUE_TOLERANCE
        if not (time_s >= self.start_s and due >= 1):  # also if a number is NaN
            return 0
        return int(min(due, n_frames - 1))

    def at_rate(self, fps: float | None) -> "Timing":
        """Frames at a given rate from the same start; the timing itself for None."""
        return self if fps is None else Timing.of_rate(fps, self.start_s)

    def part(self, frames: range) -> "Timing":
        """The timing of frames with any step; those with times of their own keep them.

        With a negative step, time runs backwards from the last frame at the time of the first.
        """
        first = self.at(frames.start if frames.step > 0 else frames[-1])
        if self.times is None:
            return Timing(self.fps / abs(frames.step), first)
        times = self.times[np.asarray(frames)]
        if frames.step > 0:
            return Timing._uneven(times)
        return Timing.of_times(first + (times[0] - times))


class Timed:
    """Frame rate, start and times of a sequence of `n_frames` frames with a `timing`."""

    timing: Timing
    n_frames: int

    @property
    def fps(self) -> float:
        """Frames per second, the mean rate if frames have times of their own; 0 = unknown."""
        return self.timing.fps

    @property
    def start_s(self) -> float:
        """Time of the first frame, in seconds."""
        return self.timing.start_s

    @property
    def times(self) -> Floats | None:
        """Time of each frame in seconds, of shape (T,); None if the frame rate is unknown."""
        return self.timing.seconds(self.n_frames)

    def frame_at(self, time_s: float) -> int:
        """Number of the frame that is shown at a time in seconds: the last one due, else 0."""
        return self.timing.frame_at(time_s, self.n_frames)


def duration_s(n_frames: int, fps: float, times: Sequence[float] | None) -> float | None:
    """Seconds from the first time to the last, of frames at a rate to the end of the last frame.

    None if the frame rate is unknown.
    """
    if times is not None:
        return times[-1] - times[0]
    return n_frames / fps if fps else None


UNTIMED = Timing()
"""Frames from 0 s on at an unknown rate."""


def _checked(times_s: Any, n_frames: int | None) -> Floats:
    try:
        times = np.asarray(times_s, np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError("times must be numbers, in seconds") from None
    if times.ndim != 1 or not len(times) or n_frames not in (None, len(times)):
        shape = "(T,)" if n_frames is None else f"({n_frames},)"
        raise InvalidInputError(f"times must have shape {shape}; got {times.shape}")
    times = times + 0.0  # -0 becomes 0
    if not np.isfinite(times).all():
        raise InvalidInputError(f"time {int(np.argmin(np.isfinite(times)))} is not finite")
    is_later = times[1:] > times[:-1]
    if not is_later.all():
        index = int(np.argmin(is_later))
        raise InvalidInputError(
            f"frame {index} is at time {times[index]:g} and frame {index + 1} at "
            f"{times[index + 1]:g}; times must ascend"
        )
    if not np.isfinite(float(times[-1]) - float(times[0])):
        raise InvalidInputError("the last time minus the first is not finite")
    return times


def rounded_rate(rate: float, tolerance: float) -> float:
    """Return the common rate that agrees with a rate, or the rate itself.

    Parameters
    ----------
    tolerance : float
        Of the relative difference.
    """
    common = (round(rate), round(rate / NTSC) * NTSC, round(rate, 2), round(rate, 3))
    near = [
        candidate
        for candidate in common
        if candidate > 0 and abs(candidate - rate) <= tolerance * rate
    ]
    exact = [candidate for candidate in near if abs(candidate - rate) <= 1e-12 * rate]
    return float((exact or near or [rate])[0])
