"""Segments of one frame against Draco at the same quantization step.

    python bench/one_frame.py samba.npz cow.npz capture/ --frames 24 --bits 10 11

Each frame is a mesh of its own: those of a capture as they are; of other sequences each frame
leaves out another 2 % of the faces. Both store connectivity and positions, without the order of
vertices and faces. Draco divides the longest side of the box of all frames into 2^bits - 1 steps;
the segments have the same step, so the error is the same up to chance. Bytes and times of Draco are
those of level 7, one frame after another. Speeds are millions of vertices per second of the whole
sequence: by wall-clock time with 1 core and with all, and by processor time; medians of several
alternating rounds.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import DracoPy
import numpy as np

import meshreel
from measuring import medians, rounds, start_table
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.threads import limit_cores, n_cores

LEVEL = 7
LEFT_OUT = 0.02
"""Share of the faces that each frame of a sequence of constant connectivity leaves out."""


def changing_frames(path: Path, n_frames: int) -> list[MeshSequence]:
    """Return the first frames of a file or a folder, each with its own faces."""
    files: Any = sorted(path.iterdir())[:n_frames] if path.is_dir() else path
    segments = meshreel.load(files, attributes="none").segments
    if len(segments) > 1:
        places = [(segment, t) for segment in segments for t in range(segment.n_frames)][:n_frames]
        return [MeshSequence(segment.read(t, t + 1), segment.faces) for segment, t in places]
    (whole,), rng = segments, np.random.default_rng(1)
    frames = whole.read(0, min(n_frames, whole.n_frames))
    return [subset(frame, whole.faces, rng) for frame in frames]


def subset(vertices: Any, faces: Any, rng: np.random.Generator) -> MeshSequence:
    """Return a frame without some faces, and without vertices that no face uses."""
    remaining = faces[rng.random(len(faces)) > LEFT_OUT]
    used, numbers = np.unique(remaining, return_inverse=True)
    return MeshSequence(vertices[None, used], numbers.reshape(-1, 3).astype(np.int32))


def rows(name: str, frames: list[MeshSequence], bits: int, n_runs: int) -> Iterator[list[str]]:
    """Yield a row for each clock: bytes and their ratio to Draco, and speeds of both."""
    meshes = [(frame.vertices[0].astype(np.float32), frame.faces) for frame in frames]
    low = np.min([vertices.min(axis=0) for vertices, _ in meshes], axis=0)
    sides = np.max([vertices.max(axis=0) for vertices, _ in meshes], axis=0).astype(float) - low
    step = float(sides.max() / (2**bits - 1) / np.linalg.norm(sides))
    segmented = MeshSequence.of_segments(frames)
    n_verts = sum(len(vertices) for vertices, _ in meshes)

    def encode() -> bytes:
        return meshreel.encode(segmented, "grid", step=step, order="drop")

    def encode_draco() -> list[bytes]:
        options = {
            "quantization_bits": bits,
            "compression_level": LEVEL,
            "quantization_range": float(sides.max()),
            "quantization_origin": low.tolist(),
        }
        return [DracoPy.encode(vertices, faces, **options) for vertices, faces in meshes]

    own, other = encode(), encode_draco()
    size, other_size = len(own), sum(map(len, other))
    works: dict[str, Callable[[], Any]] = {
        "encode": encode,
        "encode draco": encode_draco,
        "decode": lambda: meshreel.decode(own),
        "decode draco": lambda: [DracoPy.decode(stream) for stream in other],
    }
    every = n_cores()

    def run(work: Callable[[], Any], cores: int) -> None:
        limit_cores(cores)
        work()

    tasks = {
        (task, cores): partial(run, work, cores)
        for cores in (1, every)
        for task, work in works.items()
    }
    seconds = medians(rounds(tasks, n_runs))

    def speed(task: str, cores: int, clock: int) -> float:
        return n_verts / 1e6 / seconds[task, cores][clock]

    case = [f"{name}, {len(frames)} x {n_verts // len(frames)}", str(bits)]
    case += [str(size), f"{size / other_size:.3f}"]
    for label, cores, kind in (("1 core", 1, 0), (f"{every} cores", every, 0), ("processor", 1, 1)):
        cells = []
        for task in ("encode", "decode"):
            mine, draco = speed(task, cores, kind), speed(f"{task} draco", cores, kind)
            cells += [f"{mine:.2f}", f"{draco:.2f}", f"{mine / draco:.2f}"]
        yield [*case, label, *cells]


def main() -> None:
    """Compare all files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("inputs", nargs="+", type=Path)
    parser.add_argument("--frames", type=int, default=24, help="at most this many of each")
    parser.add_argument("--bits", nargs="+", type=int, default=[9, 10, 11, 12])
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    speeds = [f"{task}, {of}" for task in ("encode", "decode") for of in ("own", "Draco", "ratio")]
    print_row = start_table("sequence", "bits", "bytes", "of Draco", "clock", *speeds)
    for path in options.inputs:
        frames = changing_frames(path, options.frames)
        for bits in options.bits:
            for row in rows(path.stem, frames, bits, options.runs):
                print_row(*row)


if __name__ == "__main__":
    main()
