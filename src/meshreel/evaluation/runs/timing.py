"""Timing: short work is repeated, and the median is reported with the machine and its software."""

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from meshreel import __version__
from meshreel.runtime.extras import PEERS

REPEAT_BELOW_S = 2.0
REPEATS = 3
Value = TypeVar("Value")


def timed(work: Callable[[], Value], n_repeats: int) -> tuple[Value, list[float]]:
    """Return the value of the work, and the wall-clock seconds of each run.

    Long work is run once.
    """
    value, wall_s, _ = timed_on_both_clocks(work, n_repeats)
    return value, wall_s


def timed_on_both_clocks(
    work: Callable[[], Value], n_repeats: int
) -> tuple[Value, list[float], list[float]]:
    """Return the value of the work, and wall-clock and processor seconds of each run.

    Processor seconds include all threads of this process. Long work is run once.
    """
    wall_s: list[float] = []
    processor_s: list[float] = []
    while True:
        start, start_processor = time.perf_counter(), time.process_time()
        value = work()
        wall_s.append(time.perf_counter() - start)
        processor_s.append(time.process_time() - start_processor)
        if len(wall_s) >= n_repeats or wall_s[0] >= REPEAT_BELOW_S:
            return value, wall_s, processor_s


def seconds_of(encode_s: list[float], decode_s: list[float]) -> dict[str, Any]:
    """Seconds of encoding and decoding: medians and all runs."""
    return {
        "encode": statistics.median(encode_s),
        "decode": statistics.median(decode_s),
        "encode_runs": encode_s,
        "decode_runs": decode_s,
    }


def processor_seconds_of(
    encode_s: Sequence[list[float]], decode_s: Sequence[list[float]]
) -> dict[str, Any]:
    """As `seconds_of`, with medians of processor seconds.

    Parameters
    ----------
    encode_s, decode_s : two lists each
        Wall-clock and processor seconds of each run.
    """
    return {
        **seconds_of(encode_s[0], decode_s[0]),
        "encode_processor": statistics.median(encode_s[1]),
        "decode_processor": statistics.median(decode_s[1]),
    }


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
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
