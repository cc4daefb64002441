"""The machine and software versions of measurements."""

import os
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from meshreel import __version__
from meshreel.runtime.extras import PEERS


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
