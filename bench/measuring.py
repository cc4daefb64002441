"""What the benchmarks share: alternating rounds, and tables with the machine."""

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

from meshreel.studies.study import markdown_table
from meshreel.studies.timing import machine_facts, machine_line

Name = TypeVar("Name")

MIN_ROUNDS = 3
UNSTEADY = 1.5
"""Runs are unsteady if the slowest exceeds the fastest by this factor."""


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return the result of the work, and its wall-clock and processor seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - processor


def rounds(
    tasks: Mapping[Name, Callable[[], Any]],
    n_rounds: int = 5,
    *,
    budget_s: float = float("inf"),
    clock: Callable[[], float] = time.perf_counter,
) -> dict[Name, list[float]]:
    """Seconds of each task, in alternating rounds after a warm-up round.

    The budget of time applies after three rounds.
    """
    runs: dict[Name, list[float]] = {name: [] for name in tasks}
    begin, n_done = time.perf_counter(), 0
    while n_done <= MIN_ROUNDS or (n_done <= n_rounds and time.perf_counter() - begin < budget_s):
        for name, task in tasks.items():
            start = clock()
            task()
            runs[name].append(clock() - start)
        n_done += 1
    return {name: seconds[1:] for name, seconds in runs.items()}


def medians(runs: Mapping[Name, Sequence[float]]) -> dict[Name, float]:
    """The median of every task."""
    return {name: median(seconds) for name, seconds in runs.items()}


def is_unsteady(seconds: Sequence[float]) -> bool:
    """Whether the times of a task differ too much to be reliable."""
    return max(seconds) > UNSTEADY * min(seconds)


def print_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table below a title, which may be empty."""
    print(f"{title}\n\n" if title else "", markdown_table(header, rows), "\n", sep="", flush=True)


def machine_text() -> str:
    """A sentence on this machine."""
    return f"{machine_line(machine_facts())}."


def store(path: Path | None, **figures: Any) -> None:
    """Write figures and the machine as JSON, if there is a path."""
    if path is not None:
        text = json.dumps({"machine": machine_facts(), **figures}, indent=1)
        path.write_text(text + "\n", encoding="utf-8")
