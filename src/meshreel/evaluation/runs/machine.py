"""The machine and the versions that seconds were measured with."""

import os
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from meshreel import __version__


def machine_facts() -> dict[str, str | int]:
    """Processor, cores, system and versions, in plain types."""
    return {
        "cpu": cpu_model(),
        "cores": os.cpu_count() or 1,
        "platform": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "meshreel": __version__,
    }


def machine_line(facts: Mapping[str, Any]) -> str:
    """The facts in one line."""
    return (
        f"{facts['cpu']}, {facts['cores']} cores, {facts['platform']}, Python {facts['python']}, "
        f"NumPy {facts['numpy']}, SciPy {facts['scipy']}, meshreel {facts['meshreel']}"
    )


def machines_text(results: Iterable[Mapping[str, Any]]) -> str:
    """The machines that results were measured on, each once; of stored ones it may be another."""
    lines = dict.fromkeys(machine_line(result["machine"]) for result in results)
    return "Measured on: " + "; ".join(lines) + "." if lines else ""


def cpu_model() -> str:
    """The processor's name where the system tells it, else its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
