"""Memory and time of `meshreel batch` for many sequences of mixed sizes.

    python bench/batch.py --inputs 1000                  # two processes of this machine
    python bench/batch.py --inputs 1000 --dask           # two workers of a Dask cluster

Sequences are synthetic: a waving grid of 100 to 4,000 vertices and 8 to 100 frames, with a fixed
random seed. The private memory (USS) of the program and of its workers is sampled every 0.2 s and
printed for each tenth of the inputs; a memory leak shows as growth from row to row. Needs psutil,
which Dask installs.
"""

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil

import meshreel
from measuring import print_table
from meshreel.studies.timing import timed_once

TENTHS = 10
SAMPLE_PERIOD_S = 0.2


def write_inputs(folder: Path, n_inputs: int) -> None:
    """Write sequences of mixed sizes, few of them large."""
    rng = np.random.default_rng(17)
    for number in range(n_inputs):
        side = round(10 * (4000 / 100) ** (rng.random() ** 2 / 2))
        n_frames = round(8 * (100 / 8) ** rng.random())
        meshreel.save(waves(side, n_frames, rng.random(4)), folder / f"s{number:04d}.npz")


def waves(side: int, n_frames: int, drawn: Any) -> meshreel.MeshSequence:
    """A waving grid of side x side vertices, varied by random numbers."""
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing="ij")
    t = np.linspace(0, 1 + drawn[0], n_frames)[:, None, None]
    slow = np.sin(6 * (x * (1 + drawn[1]) + y * drawn[2] - t))
    z = 0.1 * slow + 0.02 * np.sin(40 * x * y + 9 * t)
    still = np.broadcast_to(np.stack([x, y], -1), (n_frames, side, side, 2))
    vertices = np.concatenate([still, z[..., None]], -1).reshape(n_frames, -1, 3)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    faces = np.concatenate(
        [corner + np.array([0, side, 1]), corner + np.array([1, side, side + 1])]
    )
    return meshreel.MeshSequence(vertices.astype(np.float32), faces, 25.0)


@contextlib.contextmanager
def dask_cluster(n_workers: int) -> Iterator[tuple[str, list[int]]]:
    """Start a local cluster; yield its address and the processes of its workers."""
    import distributed

    local_cluster: Any = distributed.LocalCluster
    with local_cluster(
        n_workers=n_workers, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster.scheduler_address, [worker.pid for worker in cluster.workers.values()]


def watch(command: list[str], workers: list[int], out: Path) -> list[Any]:
    """Run a batch; sample the number of its streams, and memory of program and workers in MiB."""
    program = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    samples: list[Any] = []
    while program.poll() is None:
        n_done = sum(1 for _ in out.glob("*.reel"))
        of_workers = workers or [child.pid for child in children_of(program.pid)]
        samples.append((n_done, mib(program.pid), sorted(map(mib, of_workers), reverse=True)[:2]))
        time.sleep(SAMPLE_PERIOD_S)
    return samples


def children_of(process: int) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return list(psutil.Process(process).children())
    return []


def mib(process: int) -> float:
    with contextlib.suppress(psutil.NoSuchProcess, psutil.AccessDenied):
        return float(psutil.Process(process).memory_full_info().uss) / 2**20
    return 0.0


def print_growth(samples: list[Any], n_inputs: int) -> None:
    """Print the largest samples of each tenth of the inputs."""
    rows = []
    for tenth in range(TENTHS):
        low, high = n_inputs * tenth // TENTHS, n_inputs * (tenth + 1) // TENTHS
        tenth_samples = [sample for sample in samples if low <= sample[0] < high]
        if tenth_samples:
            pairs = [worker_mib for *_, worker_mib in tenth_samples if len(worker_mib) == 2]
            texts = ", ".join(f"{max(rank):.0f}" for rank in zip(*pairs, strict=True))
            program_mib = max(sample[1] for sample in tenth_samples)
            rows.append([f"{low} to {high}", f"{program_mib:.0f}", texts])
    header = "inputs done", "program MiB", "workers MiB, largest in this tenth"
    print_table("", header, rows)


def main() -> None:
    """Write inputs, run the batch, and print states, times and memory."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--dask", action="store_true", help="on a Dask cluster")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        inputs, out = Path(folder) / "in", Path(folder) / "out"
        inputs.mkdir()
        out.mkdir()
        write_inputs(inputs, chosen.inputs)
        executor = ["--workers", str(chosen.workers)]
        workers: list[int] = []
        if chosen.dask:
            address, workers = stack.enter_context(dask_cluster(chosen.workers))
            executor = ["--scheduler", address]
        command = [sys.executable, "-m", "meshreel", "batch", str(inputs), str(out), *executor]
        samples, seconds = timed_once(partial(watch, command, workers, out))
        records = json.loads((out / "manifest.json").read_text())["inputs"].values()
        work = sum(record["seconds"] or 0 for record in records)
        states = {
            state: sum(record["state"] == state for record in records)
            for state in ("done", "failed")
        }
        print(f"{states}, {seconds.wall:.1f} s; work of the workers {work:.1f} s")
        print_growth(samples, chosen.inputs)


if __name__ == "__main__":
    main()
