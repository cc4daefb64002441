"""Tracks of a file beside those of its original: which can be shown, and how far they are off."""

from typing import Any

import numpy as np

from meshreel.app.viewer.original import Original
from meshreel.arrays import Values
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.reel_track import ReelTrack
from meshreel.metrics.track_errors import value_errors
from meshreel.model.tracks import TrackKind, TrackSource

N_SAMPLES = 8
"""Frames that say how large errors are of which nothing is promised."""

MOST_OF_FLOAT32 = 2
"""Bytes of integers that float32 holds exactly."""


class TrackComparison:
    """The tracks that both a file and its original have.

    Parameters
    ----------
    reel : ReelFile
        As it was made of the original: pages may play another stream.

    Attributes
    ----------
    names : list of str
        Of tracks of the same shape and kind in both.
    compared : list of str
        Those of them that can differ: the others are exact in the file.
    """

    def __init__(self, reel: ReelFile, original: Original) -> None:
        self._reel, self._original = reel, original
        given = original.tracks
        self.names = [
            name
            for name, track in reel.tracks.items()
            if name in given and _fits(given[name], track)
        ]
        self.compared = [name for name in self.names if not reel.tracks[name].is_exact]

    def given(self, name: str, number: int) -> Values:
        """Values of the original at a frame, of shape (N, C): float32, or float64 if need be."""
        values = self._original.values(name, number)
        is_single = values.dtype == np.float32 or (
            values.dtype.kind in "iu" and values.dtype.itemsize <= MOST_OF_FLOAT32
        )
        return values.astype("<f4" if is_single else "<f8")

    def all_given(self, name: str) -> Values:
        """Values of the original at all frames of the file, of shape (T, N, C)."""
        return np.stack([self._original.values(name, n) for n in range(self._reel.n_frames)])

    def differs(self, name: str) -> bool:
        """Whether any number of a track is another one in the file."""
        track = self._reel.tracks[name]
        return not all(
            np.array_equal(track[number], self._original.values(name, number), equal_nan=True)
            for number in range(self._reel.n_frames)
        )

    def kind(self, name: str) -> TrackKind:
        """What a track means."""
        return self._reel.tracks[name].kind

    def described(self) -> list[dict[str, Any]]:
        """Heat maps of the tracks that can differ, as the page takes them."""
        return [self._described(number, name) for number, name in enumerate(self.compared)]

    def _described(self, number: int, name: str) -> dict[str, Any]:
        track = self._reel.tracks[name]
        unit = "\N{DEGREE SIGN}" if track.kind is TrackKind.NORMAL else track.unit
        most = track.promised_error
        bound = (
            ""
            if most is None
            else f", up to {float(f'{most:.4g}'):g} {unit}".rstrip() + " as promised"
        )
        if most is None:
            most = self._largest_sampled(name)
        return {
            "kind": f"track {number}",
            "label": f"error of {name}{bound}",
            "unit": unit,
            "maximum": most,
            "range": most,
            "track": name,
        }

    def _largest_sampled(self, name: str) -> float:
        """The largest error at some frames; where one of two values is missing, it counts not."""
        track = self._reel.tracks[name]
        frames = np.unique(np.linspace(0, self._reel.n_frames - 1, N_SAMPLES).round()).astype(int)
        errors = [
            value_errors(self._original.values(name, n)[None], track[n][None], track.kind)
            for n in frames.tolist()
        ]
        found = np.concatenate(errors)
        return float(np.max(found, initial=0.0, where=np.isfinite(found)))


def _fits(given: TrackSource, track: ReelTrack) -> bool:
    first, second = (
        (one.domain, one.kind, one.dtype.kind == "f", *one.shape[1:]) for one in (given, track)
    )
    return first == second
