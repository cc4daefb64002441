"""Runs, which produce one result each, and results on disk: a JSON file and its stream."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.errors import MeshReelError
from meshreel.evaluation.folder import file_name, write_text
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

LAYOUT = 2
"""Version of the JSON layout; results of other layouts are recomputed."""

Result = dict[str, Any]


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

    def identity(self, setting: Any) -> dict[str, Any]:
        """Everything that determines a result."""
        return {
            "layout": LAYOUT,
            "version": __version__,
            "sequence": self.sequence,
            "setting": setting,
        }

    def find(self, key: str, setting: Any, needs: Sequence[str] = ()) -> Result | None:
        """Return the stored result of this key, or None if it must be computed.

        A result is invalid if it is damaged, has another identity or lacks a needed file; refusals
        have no files.
        """
        try:
            result = json.loads(self.path(key, "json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(result, dict) or result.get("identity") != self.identity(setting):
            return None
        is_complete = all(self.path(key, extension).is_file() for extension in needs)
        return result if is_complete or "refused" in result else None

    def write(
        self, key: str, setting: Any, figures: Result, files: Mapping[str, bytes] | None = None
    ) -> Result:
        """Store files, then figures with their identity; return the stored result."""
        for extension, data in (files or {}).items():
            with replace_when_done(self.path(key, extension), overwrite=True) as temporary:
                temporary.write_bytes(data)
        text = json.dumps({"identity": self.identity(setting), **figures}, indent=1)
        write_text(self.path(key, "json"), text)
        result: Result = json.loads(text)
        return result


def done(results: Iterable[Result]) -> list[Result]:
    """The results that are not refusals."""
    return [result for result in results if "refused" not in result]


def without_identities(results: Iterable[Result]) -> list[Result]:
    """The results without what identifies their setting."""
    return [{name: one for name, one in result.items() if name != "identity"} for result in results]


def sequence_identity(sequence: MeshSequence) -> dict[str, Any]:
    """Name, shape and a hash of the content; of several segments the largest counts."""
    digest = hashlib.sha256()
    segments = sequence.segments
    for segment in segments:
        for array in (segment.read(0, segment.n_frames), segment.faces):
            digest.update(f"{array.dtype.str} {array.shape}".encode())
            digest.update(array.tobytes())
    several = {"n_segments": len(segments)} if len(segments) > 1 else {}
    return {
        "name": sequence.name,
        "n_frames": sequence.n_frames,
        **several,
        "n_verts": max(segment.n_verts for segment in segments),
        "n_faces": max(len(segment.faces) for segment in segments),
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


@dataclass(frozen=True)
class Outcome:
    """Figures of a run, and files to store with them, by file extension."""

    figures: dict[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """One measurement on a sequence.

    Attributes
    ----------
    name : str
        Name in progress reports.
    key : str
        Stem of its files.
    setting : dict of plain types
        Everything that the result depends on besides the sequence.
    measure : callable
        Takes a progress callback and returns the outcome.
    facts : dict of plain types
        Stored with the figures or the refusal.
    needs : tuple of str
        Extensions of the files without which a stored result is invalid.
    is_foreign : bool
        Whether it calls third-party packages; then any exception is stored as a refusal.
    """

    name: str
    key: str
    setting: dict[str, Any]
    measure: Callable[[Progress], Outcome]
    facts: dict[str, Any] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    is_foreign: bool = False


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


def result_of(run: Run, store: Store, progress: Progress = silent) -> Result:
    """Return the stored result of a run, or execute it and store the result.

    Returns
    -------
    dict of plain types; instead of figures it may contain "refused" with a reason
    """
    stored = store.find(run.key, run.setting, run.needs)
    if stored is not None:
        return stored
    try:
        outcome = run.measure(progress)
    except MeshReelError as error:
        return _refused(run, store, str(error))
    except MemoryError:
        raise
    except Exception as error:
        if not run.is_foreign:
            raise
        return _refused(run, store, f"{type(error).__name__}: {error}")
    return store.write(run.key, run.setting, {**run.facts, **outcome.figures}, outcome.files)


def _refused(run: Run, store: Store, reason: str) -> Result:
    return store.write(run.key, run.setting, {**run.facts, "refused": reason})


def _within(progress: Progress, run: str, count: Count) -> Progress:
    """A progress callback that reports the run, its stage and the number of finished runs."""
    return lambda stage, _: progress(f"{run}, {stage}" if stage else run, count)
