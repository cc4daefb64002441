"""Runs, each of which produces one result that is stored and reused."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from meshreel.errors import MeshReelError
from meshreel.evaluation.runs.store import Result, Store
from meshreel.runtime.progress import Count, Progress, silent


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
