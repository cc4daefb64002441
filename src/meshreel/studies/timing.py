"""Timing: short work is repeated, and the median is reported with the machine and its software."""

import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from meshreel.arrays import Floats
from meshreel.runtime.extras import PEERS
from meshreel.runtime.threads import limit_cores, one_blas_thread
from meshreel.runtime.version import __version__

REPEAT_BELOW_S = 2.0
REPEATS = 3
Value = TypeVar("Value")


class Seconds(NamedTuple):
    """Seconds of one run."""

    wall: float
    processor: float
    """Of all threads of this process."""


def timed_once(work: Callable[[], Value]) -> tuple[Value, Seconds]:
    """Return the value of the work and the seconds of its only run."""
    start, start_processor = time.perf_counter(), time.process_time()
    value = work()
    return value, Seconds(time.perf_counter() - start, time.process_time() - start_processor)


@contextmanager
def one_thread() -> Iterator[None]:
    """A context in which BLAS and our own code use one thread."""
    limit = limit_cores(1)
    try:
        with one_blas_thread():
            yield
    finally:
        limit_cores(limit)


def timed(
    work: Callable[[], Value], n_repeats: int = REPEATS, repeat_below_s: float = REPEAT_BELOW_S
) -> tuple[Value, Floats]:
    """Return the value of the work and the seconds of each run; long work is run once.

    Returns
    -------
    value, float64 array of shape (runs, 2)
        Wall-clock seconds, and processor seconds of all threads of this process.
    """
    runs: list[Seconds] = []
    while True:
        value, seconds = timed_once(work)
        runs.append(seconds)
        if len(runs) >= n_repeats or runs[0].wall >= repeat_below_s:
            return value, np.array(runs)


def seconds_of(encoding: Floats, decoding: Floats) -> dict[str, Any]:
    """Medians of wall-clock and processor seconds, and the processor seconds of all runs."""
    figures: dict[str, Any] = {}
    for phase, runs in (("encode", encoding), ("decode", decoding)):
        wall, processor = np.median(runs, axis=0).tolist()
        figures |= {phase: wall, f"{phase}_processor": processor}
        figures[f"{phase}_runs"] = runs[:, 1].tolist()
    return figures


def machine_facts() -> dict[str, str | int]:
    """Processor, cores, system and versions, in plain types."""
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count() or 1,
        "platform": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": PEERS.load().__version__,
        "meshreel": __version__,
    }


def machine_line(facts: Mapping[str, Any]) -> str:
    """One-line description of a machine."""
    return (
        f"{facts['cpu']}, {facts['cores']} cores, {facts['platform']}, Python {facts['python']}, "
        f"NumPy {facts['numpy']}, SciPy {facts['scipy']}, meshreel {facts['meshreel']}"
    )


def machines_text(results: Iterable[Mapping[str, Any]]) -> str:
    """The distinct machines of results; stored results may be from other machines."""
    lines = dict.fromkeys(machine_line(result["machine"]) for result in results)
    return "Measured on: " + "; ".join(lines) + "." if lines else ""


def cpu_model() -> str:
    """Name of the processor, or its architecture if the system does not report the name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
