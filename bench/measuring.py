"""What the benchmarks share: alternating rounds, and tables with the machine."""

import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

from meshreel.studies.study import markdown_row, markdown_table
from meshreel.studies.timing import Seconds, machine_facts, machine_line, timed_once

Name = TypeVar("Name")

MIN_ROUNDS = 3
UNSTEADY = 1.5
"""Runs are unsteady if the slowest exceeds the fastest by this factor."""


def peak_mib() -> float:
    """Peak memory of this process so far."""
    import resource  # not on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def rounds(
    tasks: Mapping[Name, Callable[[], Any]],
    n_rounds: int = 5,
    *,
    budget_s: float = float("inf"),
    timed: Callable[[Callable[[], Any]], tuple[Any, Seconds]] = timed_once,
) -> dict[Name, list[Seconds]]:
    """Seconds of each task, in alternating rounds after a warm-up round.

    The budget of time applies after three rounds.
    """
    runs: dict[Name, list[Seconds]] = {name: [] for name in tasks}
    begin, n_done = time.perf_counter(), 0
    while n_done <= MIN_ROUNDS or (n_done <= n_rounds and time.perf_counter() - begin < budget_s):
        for name, task in tasks.items():
            runs[name].append(timed(task)[1])
        n_done += 1
    return {name: seconds[1:] for name, seconds in runs.items()}


def medians(runs: Mapping[Name, Sequence[Seconds]]) -> dict[Name, Seconds]:
    """The medians of both clocks for every task."""
    return {name: Seconds(*map(median, zip(*times, strict=True))) for name, times in runs.items()}


def is_unsteady(runs: Sequence[Seconds]) -> bool:
    """Whether the wall-clock times of a task differ too much to be reliable."""
    seconds = [run.wall for run in runs]
    return max(seconds) > UNSTEADY * min(seconds)


def print_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table below a title, which may be empty."""
    print(f"{title}\n\n" if title else "", end="")
    print_row = start_table(*header)
    for row in rows:
        print_row(*row)
    print()


def start_table(*header: str) -> Callable[..., None]:
    """Print the head of a Markdown table; return the function that prints a row of cells."""
    print(markdown_table(header, ()), flush=True)
    return lambda *cells: print(markdown_row(cells), flush=True)


def machine_text() -> str:
    """A sentence on this machine."""
    return f"{machine_line(machine_facts())}."


def store(path: Path | None, **figures: Any) -> None:
    """Write figures and the machine as JSON, if there is a path."""
    if path is not None:
        text = json.dumps({"machine": machine_facts(), **figures}, indent=1)
        path.write_text(text + "\n", encoding="utf-8")
