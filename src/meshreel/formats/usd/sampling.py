"""Selection of the time codes at which a mesh has its frames."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.scenes.timing import MAX_FRAMES

Codes = npt.NDArray[np.float64]

MAX_CODE = 1e9
MAX_UPSAMPLING = 4
"""Largest ratio of frames to samples when gaps between uneven samples are filled."""

ARE_FRAMES = "meshreel:frames"
"""Key of the custom data that meshreel writes with uneven times: all samples are frames."""

TOLERANCE = 1e-6
"""Tolerance of time codes, for rounding errors of layer offsets and scales."""


def attribute_codes(attribute: Any) -> list[float]:
    """Return the time codes of the samples of an attribute; for a spline, all integer codes."""
    # The oldest supported library has no splines.
    if hasattr(attribute, "HasSpline") and attribute.HasSpline():
        knots = [float(code) for code in attribute.GetSpline().GetKnots()]
        return frame_grid(min(knots), max(knots), 1.0).tolist() if knots else []
    return [float(code) for code in attribute.GetTimeSamples()]


def distinct_codes(codes: list[float], tolerance: float = TOLERANCE) -> Codes:
    """Return the codes sorted and without duplicates within a tolerance.

    Raises
    ------
    FormatError
        If a code is NaN, or so large that neighboring codes are indistinguishable.
    """
    ordered = np.sort(np.asarray(codes, np.float64))
    if len(ordered) and not np.abs(ordered).max() <= MAX_CODE:
        raise FormatError(
            f"has samples from time code {ordered[0]:g} to {ordered[-1]:g}; "
            f"expected -{MAX_CODE:g} to {MAX_CODE:g}"
        )
    distinct: Codes = ordered[np.diff(ordered, prepend=-np.inf) > tolerance]
    return distinct


def frame_grid(first: float, last: float, interval: float) -> Codes:
    """Return evenly spaced codes from the first to at least the last.

    If the last is between two frames, it is followed by one frame, which shows the final pose,
    since USD holds the last sample.

    Raises
    ------
    FormatError
        If there would be more than `MAX_FRAMES`.
    """
    n_intervals = (last - first) / interval - TOLERANCE
    if not n_intervals < MAX_FRAMES - 1:
        raise FormatError(
            f"moves from time code {first:g} to {last:g}, which makes {n_intervals:.3g} frames; "
            f"the limit is {MAX_FRAMES}"
        )
    numbers = np.arange(math.ceil(n_intervals) + 1, dtype=np.float64)
    return snap(np.float64(first) + interval * numbers)


def snap(codes: Codes) -> Codes:
    """Return the codes, rounded to integers where they are within `TOLERANCE`."""
    rounded = np.round(codes)
    return np.where(np.abs(codes - rounded) <= TOLERANCE, rounded, codes)


def even_interval(codes: Codes) -> float:
    """Return the interval of evenly spaced codes, or 0 for uneven codes or less than two."""
    if len(codes) < 2:
        return 0.0
    # From the whole range, since single gaps have rounding errors.
    interval = float(codes[-1] - codes[0]) / (len(codes) - 1)
    expected = codes[0] + interval * np.arange(len(codes))
    is_even = np.abs(codes - expected).max() <= TOLERANCE * max(1.0, interval)
    return float(snap(np.array(interval))) if is_even else 0.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Time codes of the samples that determine the positions of a mesh."""

    shape_codes: Codes
    """Samples of points and faces."""
    keys: Codes
    """Samples of transforms, joints and blend shapes, which move points between their samples."""
    are_frames: bool = False
    """Whether all samples are frames, as in files with uneven times that meshreel wrote."""
    has_clips: bool = False
    """Whether points are in value clips, which have samples between frames where a clip ends."""

    @cached_property
    def all(self) -> Codes:
        """All time codes, sorted."""
        tolerance = 0.0 if self.are_frames else TOLERANCE
        return distinct_codes([*self.shape_codes, *self.keys], tolerance)

    def moves_between_samples(self, frame_interval: float) -> bool:
        """Return whether the mesh moves between its samples, so that frames can be anywhere.

        Points with samples as dense as frames are a point cache, whose samples are the frames.
        """
        max_gap = MAX_UPSAMPLING * frame_interval * (1 + TOLERANCE)
        is_cache = len(self.shape_codes) > 1 and np.diff(self.shape_codes).min() <= max_gap
        return len(self.keys) > 1 and not is_cache

    def frames(self, frame_interval: float, origin: float) -> Codes:
        """Return the time codes of the frames of the mesh; empty if it is static.

        Parameters
        ----------
        frame_interval : float
            Time codes per frame of the stage.
        origin : float
            Time code of a frame, at or before all samples of meshes that move between samples.
        """
        if self.are_frames:
            return self.all
        if self.moves_between_samples(frame_interval):
            return sampled_codes(self.all, frame_interval, origin)
        if len(self.keys) < 2 or not (
            interval := even_interval(
                grid := even_codes(self.shape_codes, frame_interval, has_clips=self.has_clips)
            )
        ):
            return even_codes(self.all, frame_interval, has_clips=self.has_clips)
        keys = even_codes(self.keys, frame_interval)
        first = grid[0] - interval * max(0, math.ceil((grid[0] - keys[0]) / interval - TOLERANCE))
        last = grid[-1] + interval * max(0, math.ceil((keys[-1] - grid[-1]) / interval - TOLERANCE))
        return grid if (first, last) == (grid[0], grid[-1]) else frame_grid(first, last, interval)


def sampled_codes(samples: Codes, frame_interval: float, origin: float) -> Codes:
    """Return the frames of a mesh that moves between its samples.

    They are the samples if there is at least one per frame of the stage. Otherwise the motion
    between sparse keys may be curved, and there is a frame at every frame of the stage.
    """
    codes = even_codes(samples, frame_interval)
    if len(codes) < 2 or 0 < even_interval(codes) <= frame_interval * (1 + TOLERANCE):
        return codes
    first = origin + frame_interval * math.floor((samples[0] - origin) / frame_interval + TOLERANCE)
    return frame_grid(first, float(samples[-1]), frame_interval)


def even_codes(samples: Codes, frame_interval: float, *, has_clips: bool = False) -> Codes:
    """Return the samples of points and transforms, made even if they are uneven for a known reason.

    Samples between frames of the stage are dropped if they have the same offsets from every frame,
    as for motion blur, or belong to value clips. Gaps where exporters omitted samples that are
    linear are filled with frames, if all samples are at frames of the stage. Other uneven samples
    are unchanged.
    """
    if len(samples) < 2 or even_interval(samples):
        return samples
    numbers = samples / frame_interval
    is_frame = np.abs(numbers - np.round(numbers)) <= TOLERANCE
    if even_interval(np.round(numbers[is_frame])) == 1 and not is_frame.all():
        first, last = np.round(numbers[is_frame])[[0, -1]]
        others = numbers[~is_frame]
        group = np.searchsorted(distinct_codes([*(others % 1)]), others % 1, side="right") - 1
        n_between = np.bincount(group, (others > first) & (others < last))
        # A single interval tells nothing: then offsets must also recur before or after it.
        recurs = (n_between == last - first).all() and np.bincount(group).min() > 1
        if recurs or has_clips:
            return samples[is_frame]
    interval = float(snap(np.diff(samples).min()))
    steps = (samples - samples[0]) / interval
    is_on_grid = np.abs(steps - np.round(steps)).max() <= TOLERANCE * max(1.0, steps[-1])
    is_at_frames = interval > frame_interval * (1 - TOLERANCE)
    if is_on_grid and is_at_frames and steps[-1] < MAX_UPSAMPLING * len(samples):
        return frame_grid(float(samples[0]), float(samples[-1]), interval)
    return samples
