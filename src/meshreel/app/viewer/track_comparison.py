"""Comparison of the tracks of a file and of its original."""

from typing import Any

import numpy as np

from meshreel.app.viewer.original import Original
from meshreel.arrays import Values
from meshreel.codec.reel_file import ReelFile
from meshreel.metrics.track_errors import value_errors
from meshreel.model.tracks import KIND_ROWS, TrackKind, TrackSource

N_SAMPLES = 8
"""Number of frames from which the largest error of tracks without a bound is estimated."""

MAX_EXACT_ITEMSIZE = 2
"""Largest size of integers in bytes that float32 represents exactly."""


class TrackComparison:
    """The tracks that a file and its original have in common.

    Parameters
    ----------
    reel : ReelFile
        The file itself, which a page may play re-encoded.

    Attributes
    ----------
    names : list of str
        Tracks of the same shape and kind in both.
    lossy_names : list of str
        Tracks that can differ; the others are exact in the file.
    """

    def __init__(self, reel: ReelFile, original: Original) -> None:
        self._reel, self._original = reel, original
        self.names: list[str] = [
            name
            for name, track in reel.tracks.items()
            if name in original.tracks and _properties(original.tracks[name]) == _properties(track)
        ]
        self.lossy: list[str] = [name for name in self.names if not reel.tracks[name].is_exact]

    def original_values(self, name: str, number: int) -> Values:
        """Values of the original at a frame, of shape (N, C): float32, or float64 if needed."""
        values = self._original.values(name, number)
        is_single = values.dtype == np.float32 or (
            values.dtype.kind in "iu" and values.dtype.itemsize <= MAX_EXACT_ITEMSIZE
        )
        return values.astype("<f4" if is_single else "<f8")

    def all_original_values(self, name: str) -> Values:
        """Values of the original at all frames of the file, of shape (T, N, C)."""
        return np.stack([self._original.values(name, n) for n in range(self._reel.n_frames)])

    def differs(self, name: str) -> bool:
        """Whether any value of a track differs in the file."""
        track = self._reel.tracks[name]
        return not all(
            np.array_equal(track[number], self._original.values(name, number), equal_nan=True)
            for number in range(self._reel.n_frames)
        )

    def kind(self, name: str) -> TrackKind:
        """The kind of a track."""
        return self._reel.tracks[name].kind

    def heat_maps(self) -> list[dict[str, Any]]:
        """Heat maps of the tracks that can differ, for the page."""
        heats = []
        for number, name in enumerate(self.lossy):
            track = self._reel.tracks[name]
            unit = "\N{DEGREE SIGN}" if KIND_ROWS[track.kind].is_direction else track.unit
            largest, bound = track.error_bound, ""
            if largest is None:
                largest = self._largest_sampled_error(name)
            else:  # the page shortens labels at ", up to"
                bound = f", up to {float(f'{largest:.4g}'):g} {unit}".rstrip()
            heats.append(
                {
                    "kind": f"track {number}",
                    "label": f"error of {name}{bound}",
                    "unit": unit,
                    "maximum": largest,
                    "range": largest,
                    "track": name,
                }
            )
        return heats

    def _largest_sampled_error(self, name: str) -> float:
        """The largest error in some frames, ignoring missing values."""
        track = self._reel.tracks[name]
        frames = np.unique(np.linspace(0, self._reel.n_frames - 1, N_SAMPLES).round()).astype(int)
        errors = [
            value_errors(self._original.values(name, n)[None], track[n][None], track.kind)
            for n in frames.tolist()
        ]
        samples = np.concatenate(errors)
        return float(np.max(samples, initial=0.0, where=np.isfinite(samples)))


def _properties(track: TrackSource) -> tuple[object, ...]:
    return (track.domain, track.kind, track.dtype.kind == "f", *track.shape[1:])
