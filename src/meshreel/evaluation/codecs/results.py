"""Results of one sequence: measured, and recorded elsewhere in a CSV file."""

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.measure import METHOD
from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.store import Result, done, without_identities

COLUMNS = (
    "sequence", "n", "k", "m", "codec", "params", "bytes_total", "bytes_connectivity",
    "bpvf_total", "kg_error_percent", "max_err_over_diag", "enc_s", "dec_s", "rms_err_over_diag",
)  # fmt: skip
TEXTS = ("sequence", "codec", "params")
COUNTS = ("n", "k", "m", "bytes_total", "bytes_connectivity")
NUMBERS = tuple(name for name in COLUMNS if name not in (*TEXTS, *COUNTS))

ERRORS = {
    "kg_error_percent": "KG error (%)",
    "sted": "STED",
    "max_error_percent": "largest error (% of the diagonal)",
}
RECORDED = " (recorded)"


@dataclass(frozen=True)
class RecordedPoint:
    """A row of the file.

    Attributes
    ----------
    rate_bpvf : float
        Total rate, with connectivity.
    quality : dict
        `kg_error_percent`, `max_error_percent` and `rms_error_percent`.
    """

    sequence: str
    codec: str
    params: str
    n_verts: int
    n_frames: int
    rate_bpvf: float
    quality: Mapping[str, float]
    encode_s: float
    decode_s: float


def read_recorded(path: Path) -> list[RecordedPoint]:
    """Read all rows of the file; extra columns are ignored.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, a column is missing, or a value is invalid.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
            if missing:
                raise InvalidInputError(
                    f"{path} lacks the column {', '.join(missing)}; required: {', '.join(COLUMNS)}"
                )
            return [_point(row, f"{path}, line {rows.line_num}") for row in rows]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidInputError(f"{path} is not a CSV file in UTF-8: {error}") from error


def matching(points: Iterable[RecordedPoint], sequence: Mapping[str, Any]) -> list[RecordedPoint]:
    """The points of the sequence with this name, vertex count and frame count."""
    key = (sequence["name"], sequence["n_verts"], sequence["n_frames"])
    return [point for point in points if (point.sequence, point.n_verts, point.n_frames) == key]


def _point(row: Mapping[str, str | None], where: str) -> RecordedPoint:
    texts = {name: (row[name] or "").strip() for name in TEXTS}
    for name in ("sequence", "codec"):
        if not texts[name]:
            raise InvalidInputError(f"{where}: column {name} is empty")
    counts = {name: _number(row[name], name, where, whole=True) for name in COUNTS}
    numbers = {name: _number(row[name], name, where) for name in NUMBERS}
    return RecordedPoint(
        **texts,
        n_verts=int(counts["n"]),
        n_frames=int(counts["k"]),
        rate_bpvf=numbers["bpvf_total"],
        quality={
            "kg_error_percent": numbers["kg_error_percent"],
            "max_error_percent": 100 * numbers["max_err_over_diag"],
            "rms_error_percent": 100 * numbers["rms_err_over_diag"],
        },
        encode_s=numbers["enc_s"],
        decode_s=numbers["dec_s"],
    )


def _number(text: str | None, column: str, where: str, *, whole: bool = False) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= 0 and (not whole or value == int(value))):
        kind = "a whole number" if whole else "a finite number"
        raise InvalidInputError(
            f"{where}: column {column} must be {kind}, 0 or more; got {text or ''!r}"
        )
    return value


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
            "measured": without_identities(self.measured),
            "recorded": [asdict(point) for point in self.recorded],
        }


def family(label: str) -> str:
    """The codec of a label: `sz3` for `sz3_lorenzo_2d (recorded)`."""
    return label.removesuffix(RECORDED).split("_")[0]


def _is_method(result: Result) -> bool:
    return bool(result["identity"]["setting"]["kind"] == METHOD)


def _distinct(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))
