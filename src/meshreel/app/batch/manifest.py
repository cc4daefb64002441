"""The manifest of a batch: the outcome of each input, stored after each of them."""

import json
import os
from collections import Counter
from collections.abc import Collection
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

from meshreel.errors import InvalidInputError, Keyword
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.version import __version__

MANIFEST_NAME = "manifest.json"
MADE_BY = "meshreel batch"
LAYOUT = 1
"""Version of the JSON layout."""

DONE, FAILED, PENDING = "done", "failed", "pending"

MEASURED = (
    "raw_size_bytes", "size_bytes", "image_bytes", "ratio", "kg_error_percent", "max_error_percent",
    "normal_angle_mean_deg", "tracks", "uv_error",
)  # fmt: skip
"""Fields of a `Record` that have the names of figures of `meshreel encode --json`."""


MAX_MANIFEST_SHARE, QUICK_S = 0.1, 0.02
"""Maximum share of the run time spent on writing the manifest, which is large with many inputs; it
does not limit writes faster than `QUICK_S`."""


@dataclass(frozen=True)
class Record:
    """The outcome of one input.

    Attributes
    ----------
    state : str
        "done", "failed", or "pending" if the run was stopped.
    output : str
        Path of the stream relative to the output folder.
    owns_output : bool
        Whether an existing output was made from this input: only then is it replaced without force.
    fingerprint : str
        Hash of names, sizes and modification times of the input files.
    options : dict
        Options that differ from the default.
    version : str
        Version of meshreel.
    error : str or None
        Why it failed.
    seconds : float or None
        Time to read, encode and measure it. This and the following are None unless it is done.
    raw_size_bytes, size_bytes, image_bytes, ratio, kg_error_percent, max_error_percent,
    normal_angle_mean_deg, tracks
        As in the output of `meshreel encode --json`.
    uv_error : float or None
        The largest error of a texture coordinate, in widths of a texture; None if they are exact.
    notes : list of str
        Changes made while reading, and omitted parts of the input.
    """

    state: str
    output: str
    owns_output: bool
    fingerprint: str
    options: dict[str, Any]
    version: str = __version__
    error: str | None = None
    seconds: float | None = None
    raw_size_bytes: int | None = None
    size_bytes: int | None = None
    image_bytes: int | None = None
    ratio: float | None = None
    kg_error_percent: float | None = None
    max_error_percent: float | None = None
    normal_angle_mean_deg: float | None = None
    tracks: dict[str, Any] = field(default_factory=dict)
    uv_error: float | None = None
    notes: list[str] = field(default_factory=list)


def summary_of(records: Collection[Record]) -> dict[str, Any]:
    """Numbers of records by state; total sizes and largest errors of those that are done."""
    states = Counter(record.state for record in records)
    done = [record for record in records if record.state == DONE]
    raw = sum(record.raw_size_bytes or 0 for record in done)
    size = sum(record.size_bytes or 0 for record in done)
    geometry = size - sum(record.image_bytes or 0 for record in done)
    return {
        **{state: states[state] for state in (DONE, FAILED, PENDING)},
        "raw_size_bytes": raw,
        "size_bytes": size,
        "ratio": raw / geometry if geometry else None,
        **{
            name: max((getattr(record, name) or 0.0 for record in done), default=None)
            for name in ("kg_error_percent", "max_error_percent")
        },
    }


@dataclass
class Manifest:
    """The records of an output folder."""

    path: Path
    input_dir: str
    """Path of the input folder relative to the output folder, or its remote address."""
    records: dict[str, Record]
    """By the name of the input; includes removed inputs."""
    _lines: dict[str, tuple[Record, str]] = field(default_factory=dict, repr=False)

    _next_write_s: float = 0.0

    def update(self, name: str, record: Record) -> None:
        """Replace the record of an input; write the manifest unless that takes too long."""
        self.records[name] = record
        if (began_s := monotonic()) >= self._next_write_s:
            self.write()
            if (duration_s := monotonic() - began_s) > QUICK_S:
                self._next_write_s = began_s + duration_s / MAX_MANIFEST_SHARE

    def write(self) -> None:
        """Write it atomically, replacing an earlier one."""
        head = {
            "made_by": MADE_BY,
            "layout": LAYOUT,
            "input_dir": self.input_dir,
            "summary": summary_of(self.records.values()),
        }
        lines = ",\n".join(self._line(name, record) for name, record in self.records.items())
        text = json.dumps(head, indent=1).removesuffix("\n}")
        text = f'{text},\n "inputs": {{\n{lines}\n }}\n}}'
        write_file(self.path, text.encode(), overwrite=True)

    def _line(self, name: str, record: Record) -> str:
        """A record as a line of JSON, cached because most records never change again."""
        cached, line = self._lines.get(name, (None, ""))
        if cached is not record:
            line = f"  {json.dumps(name)}: {json.dumps(asdict(record))}"
            self._lines[name] = record, line
        return line


def write_file(path: Path, data: bytes, *, overwrite: bool) -> None:
    """Write a file atomically, and create its folders; raises as `replace_all_when_done`."""
    with replace_all_when_done([path], overwrite=overwrite, makes_folder=True) as (temporary,):
        temporary.write_bytes(data)


def read_manifest(input_dir: Path | str, out_dir: Path, *, force: bool = False) -> Manifest:
    """Read the manifest of an output folder; it has no records if the file does not exist.

    Raises
    ------
    InvalidInputError
        If the file is not a manifest, or belongs to another input folder and `force` is false.
    """
    path, relative_input = out_dir / MANIFEST_NAME, str(input_dir)
    if isinstance(input_dir, Path):  # a relative path stays valid if both folders are moved
        try:
            relative = os.path.relpath(input_dir.resolve(), out_dir.resolve())
            relative_input = Path(relative).as_posix()
        except ValueError:  # on another drive
            relative_input = input_dir.resolve().as_posix()
    if not path.exists():
        return Manifest(path, relative_input, {})
    try:
        facts = json.loads(path.read_bytes())
        if (facts["made_by"], facts["layout"]) != (MADE_BY, LAYOUT):
            raise ValueError
        records = {str(name): Record(**record) for name, record in facts["inputs"].items()}
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InvalidInputError(
            f"{path} is not a manifest that this build of {MADE_BY} wrote; move it away, "
            "or name another folder for the outputs"
        ) from None
    if facts.get("input_dir") != relative_input and not force:
        raise InvalidInputError(
            f"{path} belongs to the inputs in {facts.get('input_dir')} (relative to it), not to "
            f"{input_dir}; name another folder for the outputs, or use ",
            Keyword("force", True),
        )
    return Manifest(path, relative_input, records)
