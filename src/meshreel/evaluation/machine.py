"""The machine and the versions that seconds were measured with."""

import os
import platform
from pathlib import Path

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


def cpu_model() -> str:
    """The processor's name where the system tells it, else its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
