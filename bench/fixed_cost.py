"""Fixed cost of a call: a cube of 12 triangles that turns and moves, and one that does not move.

    python bench/fixed_cost.py

Times are milliseconds in a process that has done the same before, with the default options: medians
of alternating rounds. The import is that of new processes, by wall-clock time.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from measuring import machine_text, medians, print_table, rounds

N_FRAMES, FPS = 50, 24.0
TURN_RAD, MOVE = 0.05, np.array([0.04, 0.01, 0.0])
"""Per frame, around the z axis and in half sides of the cube."""

N_IMPORTS = 9


def moving_cube(n_frames: int) -> meshreel.MeshSequence:
    """A cube of two units that turns and moves, in single precision."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))], np.int32)
    frames = np.arange(n_frames)[:, None]
    cosine, sine = np.cos(TURN_RAD * frames), np.sin(TURN_RAD * frames)
    x, y, z = corners.T
    turned = [cosine * x - sine * y, sine * x + cosine * y, z + 0 * frames]
    vertices = np.stack(turned, axis=2) + frames[:, None] * MOVE
    return meshreel.MeshSequence(vertices.astype(np.float32), faces, FPS)


def import_package() -> None:
    """Import the package in a new process."""
    subprocess.run([sys.executable, "-c", "import meshreel"], check=True)


def tasks_of(sequence: meshreel.MeshSequence, path: Path) -> dict[str, Callable[[], Any]]:
    """Encode, decode, and show the last frame of a file, which is written."""
    data = meshreel.encode(sequence)
    path.write_bytes(data)

    def show() -> None:
        with meshreel.open(path) as reel:
            _ = reel[-1].vertices

    return {
        "encode": partial(meshreel.encode, sequence),
        "decode": partial(meshreel.decode, data),
        "open, and show a frame": show,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=200)
    options = parser.parse_args()
    rows = []
    with TemporaryDirectory() as folder:
        for n_frames in (N_FRAMES, 1):
            path = Path(folder) / f"{n_frames}.reel"
            tasks = tasks_of(moving_cube(n_frames), path)
            name = f"cube, {n_frames} x 8 vertices, {path.stat().st_size} bytes"
            for task, seconds in medians(rounds(tasks, options.rounds)).items():
                rows.append((name, task, *(f"{1e3 * each:.2f}" for each in seconds)))
    imports = medians(rounds({"import": import_package}, N_IMPORTS))
    rows.append(("-", "start Python and import", f"{1e3 * imports['import'].wall:.0f}", "-"))
    header = "sequence", "call", "wall-clock, ms", "processor, ms"
    print_table(f"# Fixed cost\n\n{machine_text()}", header, rows)


if __name__ == "__main__":
    main()
