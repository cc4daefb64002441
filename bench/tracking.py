"""Compare tracked bases with separate decompositions of each block, in time and in bits.

    python bench/tracking.py basis samba.npz cow.npz --flag 2000 --out basis.json
    python bench/tracking.py bits samba.npz cow.npz --flag 400 --loop horse_gallop.npz
    python bench/tracking.py reel samba.npz cow.npz --flag 400

`basis`: milliseconds for the basis of one block (x, y and z), by decomposition of R and by
orthogonal iterations from the previous block, and the quality of the tracked basis.
`bits`: files of `blocks` relative to `pca-qp` with the same blocks.
`reel`: the share of temporal bases in files of `reel` with blocks.
Sequences are cut to at least two whole blocks, with more frames than modes. One BLAS thread.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import meshreel
import tracking_basis
import tracking_bits
from meshreel.evaluation.runs.timing import machine_facts, machine_line
from meshreel.runtime.threads import one_blas_thread
from speed_inputs import Source, first_frames

BLOCK_FRAMES = (10, 25, 50, 100, 200, 400, 1000)
N_MODES = (4, 10, 20)
LOOPS = 4


@dataclass(frozen=True)
class Part:
    """A measurement on a sequence with one block length, and its tables."""

    measure: Callable[[meshreel.MeshSequence, int, list[int]], dict[str, Any]]
    tables: Callable[[list[dict[str, Any]]], str]


PARTS = {
    "basis": Part(tracking_basis.measured, tracking_basis.tables),
    "bits": Part(tracking_bits.measured, tracking_bits.tables),
    "reel": Part(tracking_bits.measured_reel, tracking_bits.reel_table),
}


def looped(path: str) -> meshreel.MeshSequence:
    """The frames of a file, repeated: blocks of its length are identical."""
    once = meshreel.load(path)
    frames = once.vertices[[*range(once.n_frames)] * LOOPS]
    return meshreel.MeshSequence(frames, once.faces, once.fps, f"{once.name}, looped")


def cases(options: argparse.Namespace) -> Iterator[tuple[Source, list[int]]]:
    """Yield sequences and their block lengths."""
    chosen = options.block_frames
    for path in options.inputs:
        yield partial(meshreel.load, path), chosen
    for n_frames in options.flag:
        yield partial(meshreel.simulate_flag, n_frames), chosen
    for path in options.loop:
        yield partial(looped, path), [meshreel.load(path).n_frames]


def results(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield measurements of every valid combination of sequence and block length."""
    for source, lengths in cases(options):
        sequence = source()
        for length in lengths:
            n_blocks = sequence.n_frames // length
            n_modes = [count for count in options.modes if count < length]
            if n_blocks < 2 or not n_modes:
                continue
            whole = first_frames(sequence, n_blocks * length)
            with one_blas_thread():
                found = PARTS[options.part].measure(whole, length, n_modes)
            case = {"sequence": sequence.name, "block_frames": length, "n_blocks": n_blocks}
            yield {**case, **found}


def main() -> None:
    """Parse the command line, measure, and print Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("inputs", nargs="*", help="sequences")
    parser.add_argument("--flag", type=int, action="append", default=[], metavar="FRAMES")
    parser.add_argument("--loop", action="append", default=[], metavar="FILE")
    parser.add_argument("--block-frames", type=int, nargs="+", default=BLOCK_FRAMES)
    parser.add_argument("--modes", type=int, nargs="+", default=N_MODES)
    parser.add_argument("--out", type=Path, help="JSON with every figure")
    options = parser.parse_args()
    found = list(results(options))
    print(f"{machine_line(machine_facts())}.\n\n{PARTS[options.part].tables(found)}")
    if options.out:
        document = {"part": options.part, "machine": machine_facts(), "results": found}
        options.out.write_text(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
