"""Points of a rate-distortion plot that were measured elsewhere, from a CSV file."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.evaluation.comparison import RECORDED
from meshreel.studies.runs import Result

COLUMNS = (
    "sequence", "n", "k", "m", "codec", "params", "bytes_total", "bytes_connectivity",
    "bpvf_total", "kg_error_percent", "max_err_over_diag", "enc_s", "dec_s", "rms_err_over_diag",
)  # fmt: skip
TEXTS = ("sequence", "codec", "params")
COUNTS = ("n", "k", "m", "bytes_total", "bytes_connectivity")


def read_recorded(path: Path) -> list[Result]:
    """Read all rows of the file as results; extra columns are ignored.

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


def _point(row: Mapping[str, str | None], where: str) -> Result:
    texts = {name: (row[name] or "").strip() for name in TEXTS}
    for name in ("sequence", "codec"):
        if not texts[name]:
            raise InvalidInputError(f"{where}: column {name} is empty")
    numbers = {name: _number(row[name], name, where) for name in COLUMNS if name not in TEXTS}
    return {
        "sequence": {
            "name": texts["sequence"],
            "n_verts": int(numbers["n"]),
            "n_frames": int(numbers["k"]),
        },
        "codec": texts["codec"] + RECORDED,
        "params": texts["params"],
        "rate_bpvf": numbers["bpvf_total"],
        "quality": {
            "kg_error_percent": numbers["kg_error_percent"],
            "max_error_percent": 100 * numbers["max_err_over_diag"],
            "rms_error_percent": 100 * numbers["rms_err_over_diag"],
        },
        "seconds": {"encode": numbers["enc_s"], "decode": numbers["dec_s"]},
    }


def _number(text: str | None, column: str, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    is_count = column in COUNTS
    if not (math.isfinite(value) and value >= 0 and (not is_count or value == int(value))):
        kind = "a whole number" if is_count else "a finite number"
        raise InvalidInputError(
            f"{where}: column {column} must be {kind}, 0 or more; got {text or ''!r}"
        )
    return value
