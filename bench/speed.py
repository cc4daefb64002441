"""Seconds of encoding and decoding beside the least work they could be, in one run, as JSON.

    python bench/speed.py samba.npz --modes 20
    python bench/speed.py            # the embedded flag

The floors are what no encoder or decoder of this kind can avoid: the Gram matrix and one
projection for each axis; the product of basis and coefficients for each axis, and writing the
frames. All are timed in turn, round by round, and medians are given.
"""

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from statistics import median
from typing import Any

import meshreel
from meshreel.subspace.basis import expand, project
from meshreel.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.subspace.trajectories import bounding_frame, from_matrices, to_matrices


def seconds(work: Callable[[], Any]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def tasks_of(sequence: meshreel.MeshSequence, n_modes: int) -> dict[str, Callable[[], Any]]:
    """What is timed, by name."""
    frame = bounding_frame(sequence.vertices)
    matrices = to_matrices(sequence.vertices, frame)
    n_modes = min(n_modes, sequence.n_frames)
    _, basis = eigen_trajectories(autocorrelation(matrices), n_modes)
    coefficients = project(basis, matrices)
    data = meshreel.encode(sequence, n_modes=n_modes)

    def encode_floor() -> None:
        autocorrelation(matrices)
        project(basis, matrices)

    def decode_floor() -> None:
        from_matrices(expand(basis, coefficients), frame, sequence.vertices.dtype)

    return {
        "encode_floor": encode_floor,
        "encode": lambda: meshreel.encode(sequence, n_modes=n_modes),
        "decode_floor": decode_floor,
        "decode": lambda: meshreel.decode(data),
        "decode_one_frame": lambda: meshreel.decode(data, frames=slice(0, 1)),
    }


def measure(sequence: meshreel.MeshSequence, n_modes: int, repeats: int) -> dict[str, Any]:
    """Medians in seconds and their ratios to the floors."""
    tasks = tasks_of(sequence, n_modes)
    rounds = [{name: seconds(work) for name, work in tasks.items()} for _ in range(repeats + 1)]
    medians = {name: median(turn[name] for turn in rounds[1:]) for name in tasks}
    return {
        "sequence": sequence.name,
        "n_frames": sequence.n_frames,
        "n_verts": sequence.n_verts,
        "n_modes": n_modes,
        "repeats": repeats,
        "seconds": medians,
        "encode_by_floor": medians["encode"] / medians["encode_floor"],
        "decode_by_floor": medians["decode"] / medians["decode_floor"],
        "machine": {
            "cpus": os.cpu_count(),
            "threads": os.environ.get("OPENBLAS_NUM_THREADS", "as many as CPUs"),
            "platform": platform.platform(),
            "python": platform.python_version(),
            **{name: version(name) for name in ("meshreel", "numpy", "scipy")},
        },
    }


def main() -> None:
    """Parse the command line and print the figures."""
    parser = argparse.ArgumentParser(description="Time encoding and decoding beside their floors.")
    parser.add_argument("input", nargs="?", help="an .npz or frames; default: the embedded flag")
    parser.add_argument("--modes", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    sequence = meshreel.load(options.input) if options.input else meshreel.simulate_flag()
    json.dump(measure(sequence, options.modes, options.repeats), sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
