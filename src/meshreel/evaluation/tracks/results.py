"""Results of one track."""

import math
from dataclasses import dataclass, field
from typing import Any

from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.store import Result, done, without_identities
from meshreel.evaluation.tracks.measure import EXACTLY, OURS


@dataclass(frozen=True)
class TrackResults:
    """All measurements of a track.

    Attributes
    ----------
    slug : str
        Prefix of the names of its plots.
    sequence : dict
        Name, shape and hash.
    track : dict
        "name", "described", "shape", "error_unit", "raw_bytes" and "sha256".
    measured : list of results
        Our codec, then peers.
    """

    slug: str
    sequence: dict[str, Any]
    track: dict[str, Any]
    measured: list[Result] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Sequence and track, in tables and plots."""
        return f"{self.sequence['name'] or self.slug}, {self.track['name']}"

    @property
    def levels(self) -> list[str]:
        """The error bounds, from coarse to fine."""
        return list(dict.fromkeys(result["level"] for result in self.measured))

    @property
    def codecs(self) -> list[str]:
        """Codecs with results, ours first."""
        return list(dict.fromkeys(result["codec"] for result in done(self.measured)))

    @property
    def positions_bytes(self) -> int | None:
        """Size of the stream without the track; None if our codec has no result."""
        sizes = (run["positions_bytes"] for run in done(self.measured) if run["codec"] == OURS)
        return next(sizes, None)

    def size_bytes(self, codec: str, level: str) -> int | None:
        """Size of the track in a codec; None without a result."""
        sizes = (
            int(run["size_bytes"])
            for run in done(self.measured)
            if run["codec"] == codec and run["level"] == level
        )
        return next(sizes, None)

    def bits_per_number(self, size_bytes: int) -> float:
        """The rate that corresponds to a size."""
        n_numbers: int = math.prod(self.track["shape"])
        return 8 * size_bytes / n_numbers

    def curves(self) -> dict[str, list[Point]]:
        """Points (bits per number, largest error above 0) by codec."""
        curves: dict[str, list[Point]] = {}
        for run in done(self.measured):
            if run["level"] != EXACTLY and run["largest_error"]:
                point = self.bits_per_number(run["size_bytes"]), run["largest_error"]
                curves.setdefault(run["codec"], []).append(point)
        return {label: sorted(points) for label, points in curves.items()}

    def as_dict(self) -> dict[str, Any]:
        """All results in plain types."""
        return {
            **self.sequence,
            "track": self.track,
            "positions_bytes": self.positions_bytes,
            "measured": without_identities(self.measured),
        }
