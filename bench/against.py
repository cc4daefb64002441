"""Compare the processor time of two commits; fail if one task takes 1.2 times as long.

    python bench/against.py              # the last commit with its parent
    python bench/against.py main mine --rounds 9

Both cores are compiled as for a release, and use the libraries of this Python. Each task runs in
new processes, alternating between the commits, on one thread; a ratio is that of the medians.
"""

import argparse
import io
import os
import subprocess
import sys
import tarfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from inputs import FPS, waving_sphere
from measuring import medians, print_table, rounds
from meshreel.studies.timing import Seconds

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 1.2
BEST_OF = 5
"""Runs in each process, of which the fastest counts."""

SEQUENCE = f"""
import meshreel
import numpy as np
arrays = np.load("sphere.npz")
sequence = meshreel.MeshSequence(arrays["vertices"], arrays["faces"], {FPS})
"""
STREAM = f"{SEQUENCE}data = meshreel.encode(sequence)\n"
FILE = f"{SEQUENCE}meshreel.save(sequence, 'sphere.glb', overwrite=True)\n"
TASKS = {
    "import": ("", "import meshreel"),
    "encode": (SEQUENCE, "meshreel.encode(sequence)"),
    "encode losslessly": (SEQUENCE, "meshreel.encode(sequence, lossless=True)"),
    "decode": (STREAM, "meshreel.decode(data)"),
    "compare": (STREAM, "meshreel.compare(sequence, data)"),
    "save GLB": (SEQUENCE, "meshreel.save(sequence, 'saved.glb', overwrite=True)"),
    "load GLB": (FILE, "meshreel.load('sphere.glb')"),
}
"""Code that prepares and that is timed, by task; both use the public interface."""


def build(commit: str, folder: Path) -> Path:
    """Extract a commit into a folder, compile its core, and return the folder to import from."""
    archive = subprocess.run(
        ["git", "archive", commit, "src", "core"], cwd=ROOT, check=True, capture_output=True
    )
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
        files.extractall(folder, filter="data")
    environment = os.environ | {"MESHREEL_RELEASE": "1"}
    subprocess.run([sys.executable, folder / "core" / "compile.py"], check=True, env=environment)
    return folder / "src"


def run(task: str, source: Path, folder: Path) -> Seconds:
    """Processor seconds of a task in a new process, with the package in a folder."""
    prepare, timed = TASKS[task]
    repeats = 1 if task == "import" else BEST_OF
    timeit = ["timeit", "--process", "--unit=sec", "--number=1", f"--repeat={repeats}"]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", *timeit, "--setup", prepare, timed],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(source), "OPENBLAS_NUM_THREADS": "1"},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    # 1 loop, best of 5: 0.291 sec per loop
    seconds = float(done.stdout.partition(": ")[2].split()[0])
    return Seconds(seconds, seconds)


def is_possible(task: str, source: Path, folder: Path) -> bool:
    """Whether a commit can run a task."""
    try:
        run(task, source, folder)
    except subprocess.CalledProcessError:
        return False
    return True


def ratios(
    base: Path, changed: Path, tasks: Sequence[str], n_rounds: int, folder: Path
) -> Mapping[str, tuple[float, float]]:
    """Processor seconds with both packages, by task."""
    work = {
        (task, source): partial(run, task, source, folder)
        for task in tasks
        for source in (base, changed)
    }
    seconds = medians(rounds(work, n_rounds, timed=lambda task: (None, task())))
    return {
        task: (seconds[task, base].processor, seconds[task, changed].processor) for task in tasks
    }


def main() -> None:
    """Build both commits, print a table of the tasks, and exit with 1 if one is too slow."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("base", nargs="?", default="HEAD^", help="default: HEAD^")
    parser.add_argument("changed", nargs="?", default="HEAD", help="default: HEAD")
    parser.add_argument("--rounds", type=int, default=5, help="rounds per task, default 5")
    options = parser.parse_args()
    with TemporaryDirectory() as work:
        folder = Path(work)
        base, changed = (
            build(commit, folder / name)
            for commit, name in ((options.base, "base"), (options.changed, "changed"))
        )
        sequence = waving_sphere(4, 60)
        np.savez(folder / "sphere.npz", vertices=sequence.vertices, faces=sequence.faces)
        tasks = [task for task in TASKS if is_possible(task, base, folder)]
        figures = ratios(base, changed, tasks, options.rounds, folder)
    rows = [
        [task, f"{before:.3f}", f"{after:.3f}", f"{after / before:.2f}"]
        for task, (before, after) in figures.items()
    ]
    print_table("", ["task", f"{options.base}, s", f"{options.changed}, s", "ratio"], rows)
    if skipped := TASKS.keys() - figures.keys():
        print(f"Not possible with {options.base}: {', '.join(sorted(skipped))}.")
    slow = [task for task, (before, after) in figures.items() if after >= LIMIT * before]
    if slow:
        sys.exit(f"at least {LIMIT} times the processor time of {options.base}: {', '.join(slow)}")


if __name__ == "__main__":
    main()
