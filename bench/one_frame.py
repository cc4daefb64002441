"""Segments of one frame against Draco at the same quantization step.

    python bench/one_frame.py samba.npz cow.npz --frames 0 40
    python bench/one_frame.py capture/*.drc --bits 11

Both store connectivity and positions, without the order of vertices and faces. Draco divides the
longest side of the box into 2^bits - 1 steps; the segment has the same step, so the error is the
same up to chance. Bytes are those of level 10, seconds those of level 7. Processor seconds are the
least of several runs, with one thread.
"""

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("MESHREEL_THREADS", "1")

import DracoPy
import numpy as np

import meshreel
from meshreel.model.sequence import MeshSequence

RUNS = 7


def least_seconds(work: Callable[[], Any]) -> float:
    """Return the least processor seconds of several runs."""
    seconds = []
    for _ in range(RUNS):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return min(seconds)


def draco(sequence: MeshSequence, bits: int, level: int) -> bytes:
    """Return the frame, coded by Draco with a number of bits and a compression level."""
    vertices = sequence.vertices[0].astype(np.float32)
    side = float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    coded: bytes = DracoPy.encode(
        vertices,
        sequence.faces,
        quantization_bits=bits,
        compression_level=level,
        quantization_range=side,
        quantization_origin=vertices.min(axis=0).tolist(),
    )
    return coded


def compare(name: str, sequence: MeshSequence, bits: int) -> None:
    """Print a row: bytes of both, their ratio, and processor milliseconds of both."""
    vertices = sequence.vertices[0].astype(np.float64)
    sides = vertices.max(axis=0) - vertices.min(axis=0)
    step = float(sides.max() / (2**bits - 1) / np.linalg.norm(sides))

    def encode() -> bytes:
        return meshreel.encode(sequence, "grid", step=step, order="drop")

    own, other, fast = encode(), draco(sequence, bits, 10), draco(sequence, bits, 7)
    seconds = (
        least_seconds(encode),
        least_seconds(lambda: draco(sequence, bits, 7)),
        least_seconds(lambda: meshreel.decode(own)),
        least_seconds(lambda: DracoPy.decode(fast)),
    )
    times = " ".join(f"{1e3 * one:8.1f}" for one in seconds)
    ratio = len(own) / len(other)
    print(f"{name:24} {bits:4} {len(own):9} {len(other):9} {ratio:6.3f} {times}", flush=True)


def main() -> None:
    """Compare the chosen frames of all files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("inputs", nargs="+", type=Path)
    parser.add_argument("--frames", nargs="+", type=int, default=[0])
    parser.add_argument("--bits", nargs="+", type=int, default=[9, 10, 11, 12])
    options = parser.parse_args()
    columns = f"{'enc. ms':>9}{'Draco':>9}{'dec. ms':>9}{'Draco':>9}"
    print(f"{'frame':24} {'bits':>4} {'bytes':>9} {'Draco':>9} {'ratio':>6}{columns}")
    for path in options.inputs:
        sequence = meshreel.load(path, attributes="none")
        for frame in options.frames:
            one = MeshSequence(sequence.vertices[frame : frame + 1], sequence.faces)
            for bits in options.bits:
                compare(f"{path.stem} {frame}", one, bits)


if __name__ == "__main__":
    main()
