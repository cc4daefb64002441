"""Distances of a registered sequence and of its decoded stream from the raw frames."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.codec.reel_file import ReelFile
from meshreel.metrics.surface_distance import point_psnr_db
from meshreel.model.frame_choice import evenly_spaced
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import MeshFrame, MeshSequence
from meshreel.registration.register import Distances, Registration
from meshreel.runtime.counting import change_text, counted, size_text
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import in_threads

FRAME_INTERVAL, MIN_FRAMES = 10, 3
"""Distances of decoded frames are measured in one of this many, but not in fewer than three."""

POINT_FRAME_INTERVAL, MIN_POINT_FRAMES = 100, 1
"""The same of D1 and D2, which take two processor seconds per frame."""


@dataclass(frozen=True)
class PointPsnr:
    """D1 and D2 of MPEG's V-DMC, of some frames, as `meshreel compare` measures them.

    Attributes
    ----------
    d1_psnr_db, d2_psnr_db : float
        Means of the frames, each of the worse direction; frames without an error do not count.
    frames : tuple of int
        The measured frames.
    """

    d1_psnr_db: float
    d2_psnr_db: float
    frames: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.d1_psnr_db:.1f} and {self.d2_psnr_db:.1f} dB"


@dataclass(frozen=True, eq=False)
class Report:
    """How far registered and decoded surfaces are from the raw ones.

    Attributes
    ----------
    registered, decoded : Distances
        Of all frames, and of evenly spaced ones.
    frames : tuple of int
        These evenly spaced frames.
    points : PointPsnr
        D1 and D2 of decoded frames, evenly spaced.
    """

    registration: Registration
    registered: Distances
    decoded: Distances
    frames: tuple[int, ...]
    points: PointPsnr

    @classmethod
    def measured(
        cls,
        registration: Registration,
        decoded: MeshSequence | ReelFile,
        progress: Progress = silent,
    ) -> "Report":
        """Measure a decoded sequence or a file."""
        numbers = _chosen_numbers(registration, FRAME_INTERVAL, MIN_FRAMES)
        return cls(
            registration,
            registration.distances,
            registration.distances_of(decoded, numbers, progress),
            numbers,
            point_psnr(registration, decoded, progress),
        )

    def figures(self) -> dict[str, Any]:
        """Figures for JSON."""
        return {
            "tolerance_percent": self.registration.tolerance_percent,
            "met_percent": self.registration.met_percent,
            "registered": vars(self.registered),
            "decoded": {
                **vars(self.decoded),
                **vars(self.points),
                "frames": self.frames,
                "d1_d2_frames": self.points.frames,
            },
            "cuts": list(self.registration.cuts()),
        }

    def rows(self, size_bytes: int) -> dict[str, str]:
        """Rows of a table; `size_bytes` is that of the encoded sequence."""
        raw, registered = self.registration.raw, self.registration.sequence
        n_key, n_raw = self.registration.key_vertices
        smaller = self.registration.smaller_tolerance
        return {
            "raw": f"{size_text(raw.raw_size_bytes)} in {counted(raw.n_segments, 'segment')}",
            "ratio": (
                f"{change_text(raw.raw_size_bytes, size_bytes)}, in "
                f"{counted(registered.n_segments, 'segment')}"
            ),
            "tolerance": (
                f"{self.registration.tolerance_percent:.3g} % of the diagonal, met in every frame "
                "by 99 % of the area; the largest distance is that of the rest"
                f"{smaller and f'; {smaller} is met, too'}"
            ),
            "keys": f"kept {n_key} of {counted(n_raw, 'vertex')}",
            "registered": str(self.registered),
            "decoded": f"{self.decoded}; {self._of(self.frames)}",
            "D1 and D2 PSNR": f"decoded {self.points}; {self._of(self.points.frames)}",
            "folded faces": f"registered {self.registered.n_folded}, decoded "
            f"{self.decoded.n_folded} in the measured frames",
        }

    def notes(self) -> list[Note]:
        """Return notes that continue those of the registration."""
        decoded, points = self._of(self.frames), self._of(self.points.frames)
        return [
            Note(
                NoteKind.RESULT,
                f"decoded; distance from the raw surface: {self.decoded}; {decoded}",
            ),
            Note(NoteKind.RESULT, f"D1 and D2 PSNR: {self.points}; {points}"),
        ]

    def _of(self, numbers: tuple[int, ...]) -> str:
        n_frames = sum(segment.n_frames for segment in self.registration.segments)
        return f"of {len(numbers)} of {counted(n_frames, 'frame')}"


def point_psnr(
    registration: Registration, sequence: MeshSequence | ReelFile, progress: Progress = silent
) -> PointPsnr:
    """Return D1 and D2 between raw frames and those of a sequence or a file."""
    numbers = _chosen_numbers(registration, POINT_FRAME_INTERVAL, MIN_POINT_FRAMES)
    raw = registration.raw
    low, high = (np.asarray(corner, np.float64) for corner in (raw.extent.low, raw.extent.high))

    def measure(pair: tuple[MeshFrame, MeshFrame]) -> tuple[float, float]:
        frame, frame_hat = pair
        return point_psnr_db(
            (frame.vertices, frame.faces), (frame_hat.vertices, frame_hat.faces), low, high
        )

    def report(n_done: int) -> None:
        progress("measuring D1 and D2", Count(n_done, len(numbers), "frames"))

    report(0)
    pairs = np.array(in_threads(measure, [(raw[n], sequence[n]) for n in numbers], report))
    d1, d2 = (_mean_of_finite(column) for column in pairs.T)
    return PointPsnr(d1, d2, numbers)


def _mean_of_finite(values: Any) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else float("inf")


def _chosen_numbers(registration: Registration, interval: int, min_frames: int) -> tuple[int, ...]:
    """Return evenly spaced registered frames, one of each interval, and not fewer than given."""
    numbers = [number for segment in registration.segments for number in segment.numbers]
    n_chosen = max(min_frames, len(numbers) // interval)
    return tuple(numbers[index] for index in evenly_spaced(len(numbers), n_chosen))
