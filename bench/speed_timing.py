"""Times of alternating tasks, their medians and ratios."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any

from meshreel.runtime.threads import n_cores

Tasks = dict[str, Callable[[], Any]]
Seconds = dict[str, dict[str, float]]
Runs = dict[str, dict[str, list[float]]]

MIN_ROUNDS = 3
UNSTEADY = 1.5
"""Runs are unsteady if the slowest exceeds the fastest by this factor."""

THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Patience:
    """Limit of rounds, and a time budget that applies after three rounds."""

    most_rounds: int
    budget_s: float


def seconds(work: Callable[[], Any]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def timed_in_turn(tasks: dict[str, Tasks], patience: Patience) -> Runs:
    """Time all tasks in alternating rounds after a warm-up round."""
    rounds: list[Seconds] = []
    start = time.perf_counter()
    while len(rounds) <= MIN_ROUNDS or (
        len(rounds) <= patience.most_rounds and time.perf_counter() - start < patience.budget_s
    ):
        rounds.append(
            {
                name: {task: seconds(work) for task, work in own.items()}
                for name, own in tasks.items()
            }
        )
    return {
        name: {task: [turn[name][task] for turn in rounds[1:]] for task in own}
        for name, own in tasks.items()
    }


def medians(runs: Runs) -> Seconds:
    """The median of every task."""
    return {name: {task: median(own[task]) for task in own} for name, own in runs.items()}


def ratios(seconds_of: Seconds, base: dict[str, float]) -> Seconds:
    """Ratios of seconds to those of other coders, for tasks that both have."""
    return {
        name: {task: own[task] / base[task] for task in own if task in base}
        for name, own in seconds_of.items()
    }


def is_unsteady(runs: list[float]) -> bool:
    """Whether the times of a task differ too much to be reliable."""
    return max(runs) > UNSTEADY * min(runs)


def threads_text() -> str:
    """Number of threads of the timed work."""
    said = [f"{name}={os.environ[name]}" for name in THREAD_VARIABLES if name in os.environ]
    blas = ", ".join(said) or f"as many as usable cores ({n_cores()})"
    return f"meshreel up to {n_cores()}; matrix products of the floors {blas}; Draco 1"
