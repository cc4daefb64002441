"""Write a long sequence in every format; measure processor seconds and memory by its length.

    python bench/writers.py jumping.npz --frames 300 1000 3000

The frames of the file are repeated back and forth, with a slow drift. Each command runs in a
process of its own, which stops after half an hour of processor time.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

import meshreel
from measuring import machine_text, print_table

LIMIT_S = 1800
DRIFT = 0.02
"""Amplitude of the drift, in diagonals."""

TARGETS: dict[str, tuple[str, ...]] = {
    "glTF": ("x.glb",),
    "glTF, bones": ("x.glb", "--rig"),
    "textures": ("x.vat",),
    "Alembic": ("x.abc",),
    "USD": ("x.usdc",),
    "USD, bones": ("x.usdc", "--rig"),
    "VTKHDF": ("x.vtkhdf",),
    "ParaView": ("x.pvd",),
    "HDF5": ("x.h5",),
    "NumPy": ("x.npz",),
    "MDD": ("x.mdd",),
    "PLY": ("f/%d.ply",),
    "OBJ": ("f/%d.obj",),
}


def repeated(sequence: meshreel.MeshSequence, n_frames: int) -> meshreel.MeshSequence:
    """Return frames of a sequence back and forth, with smooth displacements that grow and wave."""
    there_and_back = [*range(sequence.n_frames), *range(sequence.n_frames - 2, 0, -1)]
    size = float(np.linalg.norm(sequence.extent.high - sequence.extent.low))
    waves = np.random.default_rng(0).normal(size=(3, 3, 3)) * 6 / size
    fields = [np.sin(sequence.vertices[0] @ wave) * DRIFT * size for wave in waves]
    vertices = np.empty((n_frames, *sequence.vertices.shape[1:]), np.float32)
    for number, frame in enumerate(vertices):
        factors = number / 1000, np.sin(number / 300), np.cos(number / 170)
        drift = np.tensordot(factors, fields, 1)
        frame[:] = sequence.vertices[there_and_back[number % len(there_and_back)]] + drift
    return meshreel.MeshSequence(vertices, sequence.faces, sequence.fps)


def measured(folder: Path, *arguments: str) -> str:
    """Run a command; return its processor seconds and peak memory in GB."""
    command = [sys.executable, "-m", "meshreel", *arguments]
    process = subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S)),
    )
    assert process.stderr is not None
    messages = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        print(messages, file=sys.stderr)
        return "-"
    return f"{usage.ru_utime + usage.ru_stime:.1f}, {usage.ru_maxrss / 1e6:.2f}"


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a sequence")
    parser.add_argument("--frames", type=int, nargs="+", default=[300, 1000, 3000])
    parser.add_argument("--only", nargs="+", help="formats, by their names in the table")
    arguments = parser.parse_args()
    source = meshreel.load(arguments.source)
    figures: dict[str, list[str]] = {}
    for n_frames in arguments.frames:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            meshreel.save(repeated(source, n_frames), folder / "long.npz")
            run = partial(measured, folder)
            commands: dict[str, tuple[str, ...]] = {
                "encode": ("encode", "long.npz", "-o", "long.reel")
            }
            commands["compare"] = ("compare", "long.npz", "long.reel")
            for title, (output, *options) in TARGETS.items():
                if not arguments.only or title in arguments.only:
                    commands[title] = ("decode", "long.reel", "-o", output, *options)
            for title, command in commands.items():
                figures.setdefault(title, []).append(run(*command))
                print(n_frames, title, figures[title][-1], file=sys.stderr, flush=True)
                for path in [*folder.glob("x*"), *folder.glob("f")]:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
    lengths = [f"{n_frames} frames: s, GB" for n_frames in arguments.frames]
    print_table(machine_text(), ["", *lengths], ((title, *row) for title, row in figures.items()))


if __name__ == "__main__":
    main()
