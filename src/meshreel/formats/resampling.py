"""Frames at a constant rate, interpolated between frames at other times."""

from collections.abc import Callable
from functools import partial

import numpy as np

from meshreel.arrays import Floats, Values
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.frames.stored_frames import Description, StoredTrack
from meshreel.formats.scenes.timing import MAX_FRAMES, blend, neighbors_of_times
from meshreel.model.notes import Notes
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.timing import DUE_TOLERANCE, Timing
from meshreel.model.tracks import TrackKind, TrackSource
from meshreel.model.validation import validate_fps
from meshreel.runtime.counting import counted


def resampled(
    opened: MeshSequence, rate: float, max_loaded_bytes: int | None, notes: Notes
) -> MeshSequence:
    """Return a sequence with frames at a rate, from the time of the first frame on.

    Positions and values of floats are interpolated linearly between the frames before and after,
    normals then have unit length; integers are those of the frame before. Where the faces change,
    the frame before is held.

    Parameters
    ----------
    rate : float
        In frames per second.
    max_loaded_bytes : int, optional
        Larger positions are computed when they are read. Default: never.
    notes : Notes
        Receives a sentence on what was done.

    Raises
    ------
    InvalidInputError
        If the rate is not above 0, the times of the frames are unknown, or there would be more than
        `MAX_FRAMES`.
    """
    if not (rate := validate_fps(rate)):
        raise InvalidInputError(Keyword("resample"), " must be above 0 frames per second")
    times = opened.times
    if times is None:
        raise InvalidInputError(
            Keyword("resample"), " needs the frame rate of the input; give it with ", Keyword("fps")
        )
    last = (times[-1] - times[0]) * rate + DUE_TOLERANCE
    if last >= MAX_FRAMES:
        raise InvalidInputError(
            Keyword("resample"),
            f" {rate:g} would give {last + 1:.6g} frames; the limit is {MAX_FRAMES}; "
            "choose a lower rate",
        )
    n_frames = int(last) + 1
    wanted = times[0] + np.arange(n_frames) / rate
    segments = []
    for number, segment in enumerate(opened.segments):
        begin, end = opened.starts[number], opened.starts[number + 1]
        is_first, is_last = begin == 0, end == opened.n_frames
        low = -np.inf if is_first else times[begin] - DUE_TOLERANCE / rate
        high = np.inf if is_last else times[end] - DUE_TOLERANCE / rate
        own = wanted[(wanted >= low) & (wanted < high)]
        if len(own):
            segments.append(_resampled(segment, times[begin:end], own, max_loaded_bytes))
    text = (
        f"resampled {counted(opened.n_frames, 'frame')} to {n_frames} at {rate:g} per second, up "
        f"to {wanted[-1]:.6g} s; positions and values in between are interpolated"
    )
    n_dropped = opened.n_segments - len(segments)
    if n_dropped:
        text += f"; {counted(n_dropped, 'segment')} between two new frames left out"
    if times[-1] > wanted[-1] + DUE_TOLERANCE / rate:
        text += f"; the last frame, at {times[-1]:.6g} s, is after the last new one"
    notes.changed("frame times", text)
    timing = Timing.of_rate(rate, opened.start_s)
    return MeshSequence.of_segments(segments, opened.name, timing)


def _resampled(
    segment: FrameSource, times: Floats, wanted: Floats, max_loaded_bytes: int | None
) -> FrameSource:
    before, after, shares = neighbors_of_times(times, wanted)

    def between(read: Callable[[int, int], Values], start: int, stop: int) -> Values:
        """Return values between frames, in their number type."""
        first, last = int(before[start]), int(after[stop - 1])
        block = read(first, last + 1)
        earlier: Values = block[before[start:stop] - first]
        if block.dtype.kind != "f" or not shares[start:stop].any():
            return earlier
        share = shares[start:stop, None, None]
        later = block[after[start:stop] - first]
        return np.where(share, blend(earlier, later, share), earlier)

    def resampled_track(track: TrackSource) -> StoredTrack:
        def read(start: int, stop: int) -> Values:
            values = between(track.read, start, stop)
            return _unit_length(values) if track.kind is TrackKind.NORMAL else values

        shape = len(wanted), *track.shape[1:]
        return StoredTrack(track.domain, track.kind, track.unit, track.dtype, shape, read)

    timing = Timing.of_times(wanted)
    about = Description(segment.faces, segment.name, timing, segment.surface)
    tracks = {name: resampled_track(track) for name, track in segment.tracks.items()}
    shape, files = (len(wanted), segment.n_verts), getattr(segment, "files", ())
    read = partial(between, segment.read)
    return about.open(shape, segment.dtype, read, files, tracks, max_loaded_bytes)


def _unit_length(normals: Values) -> Values:
    """Return normals of length 1; those of length 0 stay."""
    lengths = np.linalg.norm(normals.astype(np.float64), axis=2, keepdims=True)
    lengths[lengths == 0] = 1.0
    return np.asarray((normals / lengths).astype(normals.dtype))
