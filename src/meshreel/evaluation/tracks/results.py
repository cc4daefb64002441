"""Results of one track, as its tables and plots read them."""

import math
from dataclasses import dataclass, field
from typing import Any

from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.store import Result, done
from meshreel.evaluation.tracks.measure import OURS
from meshreel.evaluation.tracks.settings import EXACTLY


@dataclass(frozen=True)
class TrackResults:
    """Everything that was measured of a track.

    Attributes
    ----------
    slug : str
        Begins the names of its plots.
    sequence : dict
        Name, shape and hash.
    track : dict
        "name", "described", "shape", "error_unit", "raw_bytes" and "sha256".
    measured : list of results
        Of our codec, then of the peers.
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
        """What was asked for, from coarse to fine."""
        return list(dict.fromkeys(result["level"] for result in self.measured))

    @property
    def codecs(self) -> list[str]:
        """Those that have results, ours first."""
        return list(dict.fromkeys(result["codec"] for result in done(self.measured)))

    @property
    def positions_bytes(self) -> int | None:
        """Of the stream without the track; None where ours has no result."""
        ours = (one["positions_bytes"] for one in done(self.measured) if one["codec"] == OURS)
        return next(ours, None)

    def size_bytes(self, codec: str, level: str) -> int | None:
        """Bytes of the track by a codec; None where it has no result."""
        found = (
            int(one["size_bytes"])
            for one in done(self.measured)
            if one["codec"] == codec and one["level"] == level
        )
        return next(found, None)

    def bits_per_number(self, size_bytes: int) -> float:
        """The rate of so many bytes."""
        n_numbers: int = math.prod(self.track["shape"])
        return 8 * size_bytes / n_numbers

    def curves(self) -> dict[str, list[Point]]:
        """Points (bits per number, largest error above 0) by codec."""
        found: dict[str, list[Point]] = {}
        for one in done(self.measured):
            if one["level"] != EXACTLY and one["largest_error"]:
                point = self.bits_per_number(one["size_bytes"]), one["largest_error"]
                found.setdefault(one["codec"], []).append(point)
        return {label: sorted(points) for label, points in found.items()}

    def as_dict(self) -> dict[str, Any]:
        """All figures in plain types."""
        measured = [
            {name: value for name, value in result.items() if name != "identity"}
            for result in self.measured
        ]
        return {
            **self.sequence,
            "track": self.track,
            "positions_bytes": self.positions_bytes,
            "measured": measured,
        }
