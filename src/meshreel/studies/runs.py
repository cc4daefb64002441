"""Runs, which produce one result each, and results on disk: a JSON file and its stream."""

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from meshreel.errors import MeshReelError
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.version import __version__

LAYOUT = 3
"""Version of the JSON layout; results of other layouts are recomputed."""

Result = dict[str, Any]


def file_name(name: str) -> str:
    """Replace everything but letters, digits and dots by dashes, for use in file names."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or "sequence"


def write_text(path: Path, text: str) -> None:
    """Write or replace a text file atomically."""
    with replace_when_done(path, overwrite=True) as temporary:
        temporary.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Outcome:
    """Figures of a run, and files to store with them, by file extension."""

    figures: dict[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """One measurement on a sequence."""

    name: str
    """Name in progress reports."""
    key: str
    """Stem of its files."""
    setting: dict[str, Any]
    """Everything, in plain types, that the result depends on besides the sequence."""
    measure: Callable[[Progress], Outcome]
    """Takes a progress callback and returns the outcome."""
    facts: dict[str, Any] = field(default_factory=dict)
    """Plain types, stored with the figures or the refusal."""
    needs: tuple[str, ...] = ()
    """Extensions of the files without which a stored result is invalid."""
    is_foreign: bool = False
    """Whether it calls third-party packages; then any exception is stored as a refusal."""


@dataclass(frozen=True)
class Store:
    """The folder of the results of one sequence."""

    folder: Path
    sequence: dict[str, Any]

    @classmethod
    def for_sequence(cls, results: Path, sequence: MeshSequence) -> "Store":
        """Open or create the store of a sequence within a folder of results."""
        identity = sequence_identity(sequence)
        folder = results / f"{file_name(sequence.name)}-{identity['sha256'][:12]}"
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder, identity)

    def path(self, key: str, extension: str) -> Path:
        """Path of a file of a result."""
        return self.folder / f"{key}.{extension}"

    def find(self, run: Run) -> Result | None:
        """Return the stored result of a run, or None if it must be computed.

        A result is invalid if it is damaged, has another identity or lacks a needed file; refusals
        have no files.
        """
        try:
            result = json.loads(self.path(run.key, "json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(result, dict) or result.get("identity") != self._identity(run):
            return None
        is_complete = all(self.path(run.key, extension).is_file() for extension in run.needs)
        return result if is_complete or "refused" in result else None

    def write(self, run: Run, outcome: Outcome) -> Result:
        """Store files, then figures with their identity; return the stored result."""
        for extension, data in outcome.files.items():
            with replace_when_done(self.path(run.key, extension), overwrite=True) as temporary:
                temporary.write_bytes(data)
        figures = {"identity": self._identity(run), **run.facts, **outcome.figures}
        text = json.dumps(figures, indent=1)
        write_text(self.path(run.key, "json"), text)
        result: Result = json.loads(text)
        return result

    def _identity(self, run: Run) -> dict[str, Any]:
        """Everything that determines a result."""
        return {
            "layout": LAYOUT,
            "version": __version__,
            "sequence": self.sequence,
            "setting": run.setting,
        }


def result_of(run: Run, store: Store, progress: Progress = silent) -> Result:
    """Return the stored result of a run, or execute it and store the result.

    Returns
    -------
    dict of plain types; instead of figures it may contain "refused" with a reason
    """
    stored = store.find(run)
    if stored is not None:
        return stored
    try:
        outcome = run.measure(progress)
    except MeshReelError as error:
        outcome = Outcome({"refused": str(error)})
    except MemoryError:
        raise
    except Exception as error:
        if not run.is_foreign:
            raise
        outcome = Outcome({"refused": f"{type(error).__name__}: {error}"})
    return store.write(run, outcome)


def run_all(
    plan: Mapping[str, Sequence[Run]], store: Store, progress: Progress = silent
) -> dict[str, list[Result]]:
    """Execute all runs, and return their results in the groups and order of the plan."""
    n_runs, n_done = sum(map(len, plan.values())), 0
    results: dict[str, list[Result]] = {group: [] for group in plan}
    for group, runs in plan.items():
        for run in runs:
            listener = _within(progress, run.name, Count(n_done, n_runs, "runs"))
            listener("", 0.0)
            results[group].append(result_of(run, store, listener))
            n_done += 1
    return results


def _within(progress: Progress, run: str, count: Count) -> Progress:
    """A progress callback that reports the run, its stage and the number of finished runs."""
    return lambda stage, _: progress(f"{run}, {stage}" if stage else run, count)


def usable(results: Iterable[Result]) -> list[Result]:
    """The results that are not refusals."""
    return [result for result in results if "refused" not in result]


def without_identities(results: Iterable[Result]) -> list[Result]:
    """The results without the identities of their runs."""
    return [
        {name: value for name, value in result.items() if name != "identity"} for result in results
    ]


def sequence_identity(sequence: MeshSequence) -> dict[str, Any]:
    """Name, shape and a hash of the content."""
    digest = hashlib.sha256()
    for array in (sequence.vertices, sequence.faces):
        digest.update(f"{array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return {
        "name": sequence.name,
        "n_frames": sequence.n_frames,
        "n_verts": sequence.n_verts,
        "n_faces": len(sequence.faces),
        "fps": sequence.fps,
        "sha256": digest.hexdigest(),
    }


def finite(value: Any) -> Any:
    """Replace NaN and infinity, which JSON lacks, by None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
