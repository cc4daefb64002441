"""Runs: each gives one stored result, and is not done again where that is there."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from meshreel.errors import MeshReelError
from meshreel.evaluation.runs.store import Result, Store
from meshreel.runtime.progress import Count, Progress, silent


@dataclass(frozen=True)
class Outcome:
    """Figures of a run, and the files that are kept beside them.

    Attributes
    ----------
    figures : dict of plain types
    files : mapping of str to bytes
        By the extension of their names.
    """

    figures: dict[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """One thing to encode, decode and measure on a sequence.

    Attributes
    ----------
    name : str
        How progress calls it.
    key : str
        The stem of its files.
    setting : dict of plain types
        All that its result depends on beside the sequence.
    measure : callable
        Gives the outcome; is told whom to report progress to.
    facts : dict of plain types
        Stored with the figures, and with a refusal.
    needs : tuple of str
        Endings of the files without which a stored result counts as missing.
    is_foreign : bool
        Whether it calls packages of others, which raise what they like: any error is a refusal.
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
    """The results of all runs, in the groups and the order of the plan."""
    n_runs, n_done = sum(map(len, plan.values())), 0
    found: dict[str, list[Result]] = {group: [] for group in plan}
    for group, runs in plan.items():
        for run in runs:
            listener = _within(progress, run.name, Count(n_done, n_runs, "runs"))
            listener("", 0.0)
            found[group].append(result_of(run, store, listener))
            n_done += 1
    return found


def result_of(run: Run, store: Store, progress: Progress = silent) -> Result:
    """The stored result of a run, or a new one that is then stored.

    Returns
    -------
    dict of plain types; with "refused" and why where there are no figures
    """
    found = store.find(run.key, run.setting, run.needs)
    if found is not None:
        return found
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


def _refused(run: Run, store: Store, why: str) -> Result:
    return store.write(run.key, run.setting, {**run.facts, "refused": why})


def _within(progress: Progress, run: str, share: Count) -> Progress:
    """A listener that says at which stage of which run of how many the work is."""
    return lambda stage, _: progress(f"{run}, {stage}" if stage else run, share)
