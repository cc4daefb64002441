"""All measurements of one sequence."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshreel
from speed_coders import DRACO, Coder
from speed_timing import Patience, medians, ratios, timed_in_turn
from speed_trials import FLOORS, Trial, floor_tasks, serial_seconds


@dataclass(frozen=True)
class Plan:
    """The measurements of a sequence.

    Attributes
    ----------
    coders : list of Coder
    n_modes : int
        Number of modes of the floors and of the paper's serial method.
    patience : Patience
    has_serial, has_memory : bool
        Time the serial method; measure peaks of memory.
    """

    coders: list[Coder]
    n_modes: int
    patience: Patience
    has_serial: bool
    has_memory: bool


def measure(sequence: meshreel.MeshSequence, plan: Plan) -> dict[str, Any]:
    """Medians in seconds and their ratios by coder; memory and the serial method if planned."""
    with TemporaryDirectory() as folder:
        trials = [Trial(coder, sequence, Path(folder)) for coder in plan.coders]
        result = {**facts(sequence), **timed(sequence, trials, plan)}
    if plan.has_serial:
        result |= beside_serial(serial_seconds(sequence, plan.n_modes), result["seconds"])
    if plan.has_memory:
        from speed_memory import peaks_mib  # not on Windows

        peaks = {trial.coder.name: peaks_mib(trial.coder, trial.sequence) for trial in trials}
        result["memory_mib"] = peaks
    return result


def facts(sequence: meshreel.MeshSequence) -> dict[str, Any]:
    """Name and shape of a sequence."""
    return {
        "sequence": sequence.name,
        "n_frames": sequence.n_frames,
        "n_verts": sequence.n_verts,
        "n_faces": sequence.n_faces,
    }


def timed(sequence: meshreel.MeshSequence, trials: list[Trial], plan: Plan) -> dict[str, Any]:
    """Medians of coders and floors, and ratios between them."""
    tasks = floor_tasks(sequence, plan.n_modes)
    tasks |= {trial.coder.name: trial.tasks() for trial in trials}
    runs = timed_in_turn(tasks, plan.patience)
    seconds = medians(runs)
    of_coders = {trial.coder.name: seconds[trial.coder.name] for trial in trials}
    floor = {task: min(seconds[name][task] for name in FLOORS) for task in seconds[FLOORS[0]]}
    return {
        "n_rounds": len(runs[FLOORS[0]]["encode"]),
        "size_bytes": {trial.coder.name: len(trial.data) for trial in trials},
        "seconds": seconds,
        "by_draco": ratios(of_coders, seconds[DRACO]),
        "by_floor": ratios(of_coders, floor),
        "runs_s": runs,
    }


def beside_serial(
    serial: dict[str, Any], seconds_of: dict[str, dict[str, float]]
) -> dict[str, Any]:
    """Times of the serial method, and speed-ups of every decoder over it."""
    faster = {
        name: {"decode": serial["decode_s"] / own["decode"]}
        for name, own in seconds_of.items()
        if name not in FLOORS
    }
    return {"serial": serial, "by_serial": faster}
