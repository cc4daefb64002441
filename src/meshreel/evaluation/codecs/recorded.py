"""Rate-distortion points measured elsewhere, from a CSV file."""

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel.errors import InvalidInputError

COLUMNS = (
    "sequence", "n", "k", "m", "codec", "params", "bytes_total", "bytes_connectivity",
    "bpvf_total", "kg_error_percent", "max_err_over_diag", "enc_s", "dec_s", "rms_err_over_diag",
)  # fmt: skip
TEXTS = ("sequence", "codec", "params")
COUNTS = ("n", "k", "m", "bytes_total", "bytes_connectivity")
NUMBERS = tuple(name for name in COLUMNS if name not in (*TEXTS, *COUNTS))


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
