"""Seconds of encoding and decoding beside those of Draco and beside the least work there is.

    python bench/speed.py samba.npz cow.npz --efforts 1,5,9 --out speed.json
    python bench/speed.py --sphere 6 100 --memory
    python bench/speed.py            # the embedded flag

Draco codes every frame for itself. The floors are what no encoder or decoder by modes can avoid:
the Gram matrix and one projection for each axis; the product of basis and coefficients for each
axis, and writing the frames. All are timed in turn, round by round, and medians are given; a
first round is not counted.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import meshreel
from meshreel.evaluation.machine import machine_facts
from meshreel.subspace.basis import expand, project
from meshreel.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.subspace.trajectories import bounding_frame, from_matrices, to_matrices
from speed_coders import DRACO, Coder, coders_of, reel_name
from speed_inputs import add_inputs, sources
from speed_tables import report

FLOOR = "floor"
DEFAULT_EFFORT, FAST_EFFORT = 5, 1
THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
Tasks = dict[str, Callable[[], Any]]
Bounds = dict[str, dict[str, float]]


def seconds(work: Callable[[], Any]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


class Trial:
    """A coder on a sequence; what it encoded last is what it decodes."""

    def __init__(self, coder: Coder, sequence: meshreel.MeshSequence) -> None:
        self.coder = coder
        self.sequence = coder.prepare(sequence)
        self.shape = (sequence.n_frames, sequence.n_verts, 3)
        self.data = b""

    def encode(self) -> None:
        self.data = self.coder.encode(self.sequence)

    def tasks(self) -> Tasks:
        """What is timed, by name; encoding first."""
        return {
            "encode": self.encode,
            "decode": lambda: self.coder.decode(self.data, self.shape),
            "decode_one_frame": lambda: self.coder.decode_first(self.data, self.shape),
        }


def floor_tasks(sequence: meshreel.MeshSequence, n_modes: int) -> Tasks:
    """The least work of encoding and of decoding."""
    frame = bounding_frame(sequence.extent)
    matrices = to_matrices(sequence.vertices, frame)
    _, basis = eigen_trajectories(autocorrelation(matrices), min(n_modes, sequence.n_frames))
    coefficients = project(basis, matrices)

    def encode_floor() -> None:
        autocorrelation(matrices)
        project(basis, matrices)

    def decode_floor() -> None:
        from_matrices(expand(basis, coefficients), frame, sequence.vertices.dtype)

    return {"encode": encode_floor, "decode": decode_floor}


def timed_in_turn(tasks: dict[str, Tasks], repeats: int) -> dict[str, dict[str, list[float]]]:
    """Seconds of every run of every task; a round that is not counted comes first."""
    rounds = [
        {name: {task: seconds(work) for task, work in own.items()} for name, own in tasks.items()}
        for _ in range(repeats + 1)
    ]
    return {
        name: {task: [turn[name][task] for turn in rounds[1:]] for task in own}
        for name, own in tasks.items()
    }


def measure(
    sequence: meshreel.MeshSequence, coders: list[Coder], n_modes: int, repeats: int
) -> dict[str, Any]:
    """Medians in seconds and their ratios to Draco and to the floors, by coder."""
    trials = [Trial(coder, sequence) for coder in coders]
    tasks = {FLOOR: floor_tasks(sequence, n_modes)}
    tasks |= {trial.coder.name: trial.tasks() for trial in trials}
    runs = timed_in_turn(tasks, repeats)
    medians = {name: {task: median(own[task]) for task in own} for name, own in runs.items()}
    return {
        "sequence": sequence.name,
        "n_frames": sequence.n_frames,
        "n_verts": sequence.n_verts,
        "n_faces": sequence.n_faces,
        "size_bytes": {trial.coder.name: len(trial.data) for trial in trials},
        "seconds": medians,
        "by_draco": ratios(medians, DRACO),
        "by_floor": ratios(medians, FLOOR),
        "runs_s": runs,
    }


def ratios(medians: dict[str, dict[str, float]], other: str) -> dict[str, dict[str, float]]:
    """Seconds of every coder by those of another, task by task where both have it."""
    return {
        name: {task: own[task] / medians[other][task] for task in own if task in medians[other]}
        for name, own in medians.items()
        if name != other
    }


def verdicts(by_draco: dict[str, dict[str, float]], bounds: Bounds) -> dict[str, dict[str, bool]]:
    """Whether each coder that has bounds stays within them, by task."""
    return {
        name: {task: by_draco[name][task] <= most for task, most in own.items()}
        for name, own in bounds.items()
        if name in by_draco
    }


def blas_threads() -> str:
    """What the environment says of the threads of matrix products; all else runs in one."""
    said = [f"{name}={os.environ[name]}" for name in THREAD_VARIABLES if name in os.environ]
    n_usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return ", ".join(said) or f"not set: as many as usable cores, {n_usable}"


def numbers(text: str) -> list[int]:
    """The integers between commas."""
    return [int(part) for part in text.split(",")]


def parsed_options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    add_inputs(parser)
    parser.add_argument("--efforts", type=numbers, default=[1, 5, 9], help="of reel, as in 1,5,9")
    parser.add_argument("--modes", type=int, default=20, help="of the floors and of pca-qp")
    parser.add_argument("--without-paper", action="store_true", help="leave out pca-qp")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--memory", action="store_true", help="measure peak memory, too")
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    add_bounds(parser)
    return parser.parse_args()


def add_bounds(parser: argparse.ArgumentParser) -> None:
    """Options for the most that `reel` may take, in times of Draco."""
    for ending, effort, most_encode, most_decode in (
        ("", DEFAULT_EFFORT, 3.0, 1.5),
        ("-fast", FAST_EFFORT, 1.0, 1.0),
    ):
        about = f"times of Draco allowed at effort {effort}; default %(default)s"
        parser.add_argument(f"--most-encode{ending}", type=float, default=most_encode, help=about)
        parser.add_argument(f"--most-decode{ending}", type=float, default=most_decode, help=about)


def bounds_of(options: argparse.Namespace) -> Bounds:
    """The most times of Draco by coder and task."""
    return {
        reel_name(DEFAULT_EFFORT): {"encode": options.most_encode, "decode": options.most_decode},
        reel_name(FAST_EFFORT): {
            "encode": options.most_encode_fast,
            "decode": options.most_decode_fast,
        },
    }


def main() -> None:
    """Measure what the command line asks for; print tables, and write JSON where asked."""
    options, results = parsed_options(), []
    coders = coders_of(options.efforts, options.modes, with_paper=not options.without_paper)
    about = {
        "machine": {**machine_facts(), "blas_threads": blas_threads()},
        "repeats": options.repeats,
        "n_modes_of_floor": options.modes,
        "coders": [repr(coder) for coder in coders],
        "bounds_by_draco": bounds_of(options),
    }
    for source in sources(options):
        result = measure(source(), coders, options.modes, options.repeats)
        result["within_bounds"] = verdicts(result["by_draco"], bounds_of(options))
        if options.memory:
            from speed_memory import peaks_mib  # not on Windows

            result["memory_mib"] = {coder.name: peaks_mib(source, coder) for coder in coders}
        results.append(result)
        print(report(result, about), flush=True)
    if options.out:
        options.out.write_text(json.dumps({**about, "results": results}, indent=2) + "\n")


if __name__ == "__main__":
    main()
