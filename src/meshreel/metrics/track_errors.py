"""How far the values of a track are from those of the original."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource

VALUES_AT_ONCE = 1 << 21
"""Numbers that are compared at once."""


@dataclass(frozen=True, eq=False)
class TrackErrors:
    """Errors of the values of a track.

    An error is the length of the difference of two values, in `unit`; of normals the angle between
    them; of colours the largest difference of a number. It is infinite where one value is missing
    (NaN) and the other is not.

    Attributes
    ----------
    largest, rms : float
        Over all frames and places.
    largest_of_frames, rms_of_frames : float64 arrays of shape (T,)
    unit : str
        Of the track; of normals "deg".
    """

    largest_of_frames: Floats
    rms_of_frames: Floats
    unit: str

    @property
    def largest(self) -> float:
        """Largest error of all frames."""
        return float(self.largest_of_frames.max())

    @property
    def rms(self) -> float:
        """Root of the mean squared error of all frames."""
        scale = self.largest or 1.0
        if not np.isfinite(scale):
            return scale
        return scale * float(np.sqrt(np.mean(np.square(self.rms_of_frames / scale))))

    def as_dict(self) -> dict[str, Any]:
        """Every figure by name in plain Python types."""
        return {
            "largest": self.largest,
            "rms": self.rms,
            "unit": self.unit,
            "largest_of_frames": self.largest_of_frames.tolist(),
            "rms_of_frames": self.rms_of_frames.tolist(),
        }

    def __repr__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"<TrackErrors: largest {self.largest:.4g}{unit}, RMS {self.rms:.4g}{unit}>"


def errors_of_tracks(
    original: Mapping[str, TrackSource],
    decoded: Mapping[str, TrackSource],
    places: npt.NDArray[np.integer] | None = None,
) -> dict[str, TrackErrors]:
    """Errors of the tracks that both have.

    Parameters
    ----------
    original, decoded : mapping of str to TrackSource
        Of as many frames and places where names are the same.
    places : integer array of shape (V,), optional
        The decoded place of each vertex of the original. Default: the same.
    """
    return {
        name: track_errors(track, decoded[name], places if track.domain is Domain.VERTEX else None)
        for name, track in original.items()
        if name in decoded
    }


def track_errors(
    original: TrackSource,
    decoded: TrackSource,
    places: npt.NDArray[np.integer] | None = None,
) -> TrackErrors:
    """Errors of a track; the parameters are those of `errors_of_tracks`."""
    n_frames, n_items, n_columns = original.shape
    n_together = max(1, VALUES_AT_ONCE // (n_items * n_columns))
    largest, rms = np.zeros(n_frames), np.zeros(n_frames)
    for start in range(0, n_frames, n_together):
        some = slice(start, min(start + n_together, n_frames))
        there = decoded.read(some.start, some.stop)
        given = original.read(some.start, some.stop)
        errors = value_errors(given, there if places is None else there[:, places], original.kind)
        largest[some] = errors.max(axis=1)
        scales = np.where(np.isfinite(largest[some]), largest[some], 1.0)
        scales[scales == 0] = 1.0  # divided out, as above
        means = np.mean(np.square(errors / scales[:, None]), axis=1)
        rms[some] = scales * np.sqrt(means)
    return TrackErrors(largest, rms, error_unit(original))


def error_unit(track: TrackSource) -> str:
    """The unit of errors of a track: its own; "deg" of normals."""
    return "deg" if track.kind is TrackKind.NORMAL else track.unit


def value_errors(original: Values, decoded: Values, kind: TrackKind) -> Floats:
    """The error of each value, of shape (T, N), of values of shape (T, N, C)."""
    is_same = (original == decoded) | ((original != original) & (decoded != decoded))
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where(is_same, 0.0, np.subtract(decoded, original, dtype=np.float64))
    apart = np.where(np.isnan(apart), np.inf, np.abs(apart))
    if kind is TrackKind.COLOR:
        return np.asarray(apart.max(axis=2))
    if kind is TrackKind.NORMAL:
        return _angles(original, decoded, is_same.all(axis=2))
    if apart.shape[2] == 1:
        return np.asarray(apart[..., 0])
    # The largest is divided out: squares of tiny numbers are 0, of huge ones infinite.
    largest = apart.max(axis=2)
    is_scaled = (largest > 0) & np.isfinite(largest)
    shares = np.divide(
        apart, largest[..., None], where=is_scaled[..., None], out=np.zeros_like(apart)
    )
    lengths = np.sqrt(np.square(shares).sum(axis=2))
    return np.asarray(np.multiply(largest, lengths, where=is_scaled, out=largest.copy()))


def _angles(original: Values, decoded: Values, is_same: npt.NDArray[np.bool_]) -> Floats:
    """Angles in degrees; 180 where only one of two vectors is 0."""
    units = []
    for vectors in (original.astype(np.float64), decoded.astype(np.float64)):
        lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
        units.append(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))
    chords = np.linalg.norm(units[0] - units[1], axis=2)
    angles: Floats = np.degrees(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0)))
    is_there = [np.any(one != 0, axis=2) for one in units]
    angles[is_there[0] != is_there[1]] = 180.0
    angles[is_same] = 0.0
    return angles
