"""The outcome of each input of a batch, on disk after each of them."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.atomic import replace_when_done

MANIFEST_NAME = "manifest.json"
MADE_BY = "meshreel batch"
LAYOUT = 1
"""Of the JSON."""

DONE, FAILED, PENDING = "done", "failed", "pending"


@dataclass(frozen=True)
class Record:
    """The outcome of one input.

    Attributes
    ----------
    state : str
        "done", "failed", or "pending": begun by a run that was stopped.
    output : str
        The stream, within the folder of outputs.
    owns_output : bool
        Whether a file that is there was made from this input: only then is it replaced unasked.
    fingerprint : str
        Of the input: names, sizes and times of change of its files.
    options : dict
        Those that are not the default.
    version : str
        Of meshreel.
    error : str or None
        Why it failed.
    seconds : float or None
        To read, encode and measure it. This and what follows is None unless it is done.
    raw_size_bytes, size_bytes, ratio, kg_error_percent, max_error_percent, sted, tracks
        As `meshreel encode --json` gives them.
    uv_error : float or None
        The largest difference of a texture coordinate, where 1 is the width of a texture; None if
        they are exact.
    notes : list of str
        Changes made while reading, and parts of the input that are left out.
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
    ratio: float | None = None
    kg_error_percent: float | None = None
    max_error_percent: float | None = None
    sted: float | None = None
    tracks: dict[str, Any] = field(default_factory=dict)
    uv_error: float | None = None
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Manifest:
    """The records of a folder of outputs.

    Attributes
    ----------
    path : Path
    input_dir : str
        Folder of the inputs as seen from that of the outputs.
    records : dict of str to Record
        By the name of the input; those of inputs that are gone are kept.
    """

    path: Path
    input_dir: str
    records: dict[str, Record]

    def write(self) -> None:
        """Write it, whole or not at all, over what was there."""
        facts = {
            "made_by": MADE_BY,
            "layout": LAYOUT,
            "input_dir": self.input_dir,
            "inputs": {name: asdict(record) for name, record in self.records.items()},
        }
        with replace_when_done(self.path, overwrite=True) as temporary:
            temporary.write_text(json.dumps(facts, indent=1), encoding="utf-8")


def read_manifest(input_dir: Path, out_dir: Path, *, force: bool = False) -> Manifest:
    """The manifest of a folder of outputs; without records where there is none yet.

    Raises
    ------
    InvalidInputError
        If there is a file of its name that is something else, or it is of another folder of
        inputs and not `force`.
    """
    path = out_dir / MANIFEST_NAME
    seen_from_out = _seen_from(out_dir, input_dir)
    if not path.exists():
        return Manifest(path, seen_from_out, {})
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
        if (facts["made_by"], facts["layout"]) != (MADE_BY, LAYOUT):
            raise ValueError
        records = {str(name): Record(**record) for name, record in facts["inputs"].items()}
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InvalidInputError(
            f"{path} is not a manifest that this build of {MADE_BY} wrote; move it away, or name "
            "another folder for the outputs"
        ) from None
    if facts.get("input_dir") != seen_from_out and not force:
        raise InvalidInputError(
            f"{path} is of the inputs in {facts.get('input_dir')}, seen from there, not of "
            f"{input_dir}; name another folder for the outputs, or use --force"
        )
    return Manifest(path, seen_from_out, records)


def _seen_from(out_dir: Path, input_dir: Path) -> str:
    """A path that stays true when both folders are moved together."""
    try:
        return Path(os.path.relpath(input_dir.resolve(), out_dir.resolve())).as_posix()
    except ValueError:  # on another drive
        return input_dir.resolve().as_posix()
