"""Measured and recorded results of one sequence."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from meshreel.evaluation.codecs.measure import METHOD
from meshreel.evaluation.codecs.recorded import RecordedPoint
from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.store import Result, done

ERRORS = {
    "kg_error_percent": "KG error (%)",
    "sted": "STED",
    "max_error_percent": "largest error (% of the diagonal)",
}
RECORDED = " (recorded)"


@dataclass(frozen=True)
class CodecResults:
    """All results of one sequence.

    Attributes
    ----------
    slug : str
        Prefix of the names of its plots.
    sequence : dict
        Name, shape and hash.
    measured : list of results
        Our methods, then peers.
    recorded : list of RecordedPoint
        Points of a sequence with the same name and shape.
    """

    slug: str
    sequence: dict[str, Any]
    measured: list[Result] = field(default_factory=list)
    recorded: list[RecordedPoint] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The name of the sequence in tables and plots."""
        return str(self.sequence["name"]) or self.slug

    @property
    def methods(self) -> list[str]:
        """Our methods with results."""
        return _distinct(r["codec"] for r in done(self.measured) if _is_method(r))

    @property
    def peers(self) -> list[str]:
        """Other codecs with results."""
        return _distinct(r["codec"] for r in done(self.measured) if not _is_method(r))

    def curves(self, error: str) -> dict[str, list[Point]]:
        """Points (rate, error above 0) by label: methods, then peers, then recorded codecs."""
        curves: dict[str, list[Point]] = {}
        for result in done(self.measured):
            value = result["quality"][error]
            if value:
                curves.setdefault(result["codec"], []).append((result["rate_bpvf"], value))
        for point in self.recorded:
            value = point.quality.get(error)
            if value:
                curves.setdefault(point.codec + RECORDED, []).append((point.rate_bpvf, value))
        return {label: sorted(points) for label, points in curves.items()}

    def as_dict(self) -> dict[str, Any]:
        """All results in plain types."""
        return {
            **self.sequence,
            "measured": [
                {name: value for name, value in result.items() if name != "identity"}
                for result in self.measured
            ],
            "recorded": [asdict(point) for point in self.recorded],
        }


def family(label: str) -> str:
    """The codec of a label: `sz3` for `sz3_lorenzo_2d (recorded)`."""
    return label.removesuffix(RECORDED).split("_")[0]


def _is_method(result: Result) -> bool:
    return bool(result["identity"]["setting"]["kind"] == METHOD)


def _distinct(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))
