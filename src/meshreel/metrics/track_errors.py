"""Errors of the values of decoded tracks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, ErrorMeasure, TrackKind, TrackSource, error_unit

NUMBERS_PER_CHUNK = 1 << 21


@dataclass(frozen=True, eq=False)
class TrackErrors:
    """Errors of the values of a track.

    The error of a value is the length of its difference in `unit`; of a normal the angle; of a
    color the largest difference of a channel. It is infinite if only one of the two is NaN.

    Attributes
    ----------
    largest, rms : float
        Over all frames and items.
    largest_of_frames, rms_of_frames : float64 arrays of shape (T,)
    unit : str
        Unit of the track; "deg" for normals.
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
        """All errors by name in plain Python types."""
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
    order: Mapping[Domain, npt.NDArray[np.integer]] | None = None,
) -> dict[str, TrackErrors]:
    """Errors of the tracks that both mappings contain.

    Parameters
    ----------
    original, decoded : mapping of str to TrackSource
        Tracks of the same name must have equal numbers of frames and items.
    order : mapping of Domain to integer array of shape (N,), optional
        The decoded index of each vertex or cell of the original. Default: the same.
    """
    numbers = order or {}
    return {
        name: track_errors(track, decoded[name], numbers.get(track.domain))
        for name, track in original.items()
        if name in decoded
    }


def joined_errors(segments: Sequence[TrackErrors]) -> TrackErrors:
    """Errors of a track over several segments, at least one, in order."""
    largest = np.concatenate([errors.largest_of_frames for errors in segments])
    rms = np.concatenate([errors.rms_of_frames for errors in segments])
    return TrackErrors(largest, rms, segments[0].unit)


def track_errors(
    original: TrackSource,
    decoded: TrackSource,
    order: npt.NDArray[np.integer] | None = None,
) -> TrackErrors:
    """Errors of a track; `order` is the decoded index of each item of the original."""
    n_frames, n_items, n_columns = original.shape
    n_per_chunk = max(1, NUMBERS_PER_CHUNK // (n_items * n_columns))
    largest, rms = np.zeros(n_frames), np.zeros(n_frames)
    for start in range(0, n_frames, n_per_chunk):
        stop = min(start + n_per_chunk, n_frames)
        values_hat = decoded.read(start, stop)
        if order is not None:
            values_hat = values_hat[:, order]
        errors = value_errors(original.read(start, stop), values_hat, original.kind)
        largest[start:stop] = errors.max(axis=1)
        scales = np.where(np.isfinite(largest[start:stop]), largest[start:stop], 1.0)
        scales[scales == 0] = 1.0
        means = np.mean(np.square(errors / scales[:, None]), axis=1)
        rms[start:stop] = scales * np.sqrt(means)
    return TrackErrors(largest, rms, error_unit(original.kind, original.unit))


def value_errors(original: Values, decoded: Values, kind: TrackKind) -> Floats:
    """Errors of shape (T, N) of values of shape (T, N, C)."""
    is_same = (original == decoded) | ((original != original) & (decoded != decoded))
    with np.errstate(invalid="ignore", over="ignore"):
        offsets = np.where(is_same, 0.0, np.subtract(decoded, original, dtype=np.float64))
    offsets = np.where(np.isnan(offsets), np.inf, np.abs(offsets))
    measure = KIND_ROWS[kind].error
    if measure is ErrorMeasure.NUMBER:
        return np.asarray(offsets.max(axis=2))
    if measure is ErrorMeasure.ANGLE:
        return _angles(original, decoded, is_same.all(axis=2))
    if offsets.shape[2] == 1:
        return np.asarray(offsets[..., 0])
    # Normalized by the largest: squares of tiny numbers underflow, of huge ones overflow.
    largest = offsets.max(axis=2)
    is_scaled = (largest > 0) & np.isfinite(largest)
    scaled = np.divide(
        offsets, largest[..., None], where=is_scaled[..., None], out=np.zeros_like(offsets)
    )
    lengths = np.sqrt(np.square(scaled).sum(axis=2))
    return np.asarray(np.multiply(largest, lengths, where=is_scaled, out=largest.copy()))


def _angles(original: Values, decoded: Values, is_same: npt.NDArray[np.bool_]) -> Floats:
    """Angles in degrees; 180 if only one of two vectors is 0."""
    units = []
    for vectors in (original.astype(np.float64), decoded.astype(np.float64)):
        lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
        units.append(np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0))
    chords = np.linalg.norm(units[0] - units[1], axis=2)
    angles: Floats = np.degrees(2.0 * np.arcsin(np.clip(chords / 2.0, 0.0, 1.0)))
    is_nonzero = [np.any(unit != 0, axis=2) for unit in units]
    angles[is_nonzero[0] != is_nonzero[1]] = 180.0
    angles[is_same] = 0.0
    return angles
