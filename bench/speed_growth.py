"""Growth of encoding and decoding times with vertices and with frames."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from speed_coders import Coder
from speed_inputs import Source, long_flag, waving_sphere
from speed_timing import Patience, medians, timed_in_turn
from speed_trials import Trial

SUBDIVISIONS = (5, 6, 7)
FRAMES_OF_SPHERES = 48
FRAMES_OF_FLAGS = (250, 1000, 5000)
SERIES: dict[str, list[Source]] = {
    "vertices": [partial(waving_sphere, n, FRAMES_OF_SPHERES) for n in SUBDIVISIONS],
    "frames": [partial(long_flag, n) for n in FRAMES_OF_FLAGS],
}


def growth(of: str, coder: Coder, patience: Patience) -> dict[str, Any]:
    """Medians of encoding and decoding by size, and the exponents of their growth."""
    sequences = [source() for source in SERIES[of]]
    with TemporaryDirectory() as folder:
        trials = [Trial(coder, sequence, Path(folder)) for sequence in sequences]
        labels = [f"{sequence.n_verts} x {sequence.n_frames}" for sequence in sequences]
        tasks = {label: trial.coding_tasks() for label, trial in zip(labels, trials, strict=True)}
        runs = timed_in_turn(tasks, patience)
    seconds = list(medians(runs).values())
    sizes = [size_of(sequence, of) for sequence in sequences]
    by_task = {task: [times[task] for times in seconds] for task in seconds[0]}
    return {
        "of": of,
        "coder": coder.name,
        "sequences": sorted({sequence.name for sequence in sequences}),
        "sizes": sizes,
        "n_rounds": len(runs[labels[0]]["encode"]),
        "seconds": by_task,
        "exponents": {task: exponent(sizes, by_task[task]) for task in by_task},
        "steepest_exponents": {task: steepest(sizes, by_task[task]) for task in by_task},
        "runs_s": runs,
    }


def size_of(sequence: meshreel.MeshSequence, of: str) -> int:
    """Number of vertices or frames of a sequence."""
    return sequence.n_verts if of == "vertices" else sequence.n_frames


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Least-squares slope on logarithmic axes."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def steepest(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """The largest slope between consecutive sizes, which a global fit may hide."""
    return float(np.max(np.diff(np.log(seconds)) / np.diff(np.log(sizes))))
