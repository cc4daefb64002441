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
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
import numpy.typing as npt
from scipy.fft import idct
from scipy.linalg import eigh, subspace_angles

import meshreel
from inputs import Source, first_frames
from measuring import machine_text, medians, print_table, rounds, store
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.encoding import basis_coding
from meshreel.codec.reel.normative.blocks import write_basis
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories, fix_signs
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.kernel.basis import time_order
from meshreel.kernel.library import call
from meshreel.metrics.position_errors import position_errors
from meshreel.paper import pipeline
from meshreel.paper.basis import advance_basis, align_basis, ritz_vectors
from meshreel.runtime.threads import one_blas_thread
from meshreel.studies.rate_distortion import bd_rate

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Figures = dict[str, Any]

BLOCK_FRAMES = (10, 25, 50, 100, 200, 400, 1000)
N_MODES = (4, 10, 20)
LOOPS = 4

TIMED_BLOCKS = 3
ITERATIONS = (1, 2, 4)
CHAINED = (0, 1, 2, 4, 8, 16)
USEFUL_PERCENT = 1.0
"""Largest excess error, in percent, of a useful tracked basis."""

BITS = (8, 9, 10)
SHOWN_BITS = 9
VARIANTS: dict[str, dict[str, Any]] = {
    "fresh": {"method": "pca-qp"},
    "t = 1": {"method": "blocks", "n_iterations": 1},
    "t = 2": {"method": "blocks", "n_iterations": 2},
    "t = 4": {"method": "blocks", "n_iterations": 4},
    "eigh, differences": {"method": "blocks"},
}
SHOWN = "t = 4"


def measure_basis(sequence: meshreel.MeshSequence, length: int, all_modes: list[int]) -> Figures:
    """Milliseconds and quality for every number of modes, and the seconds of whole encodings."""
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.extent))
    blocks = np.split(matrices, sequence.n_frames // length, axis=1)
    correlations = [autocorrelation(block) for block in blocks]
    encodings = {
        method: partial(
            meshreel.encode, sequence, method, block_frames=length, n_modes=all_modes[-1],
            order="drop",
        )
        for method in ("pca-qp", "blocks")
    }  # fmt: skip
    seconds = medians(rounds(encodings, budget_s=3.0))
    return {
        "modes": [
            {
                "n_modes": n_modes,
                "milliseconds": milliseconds(blocks, correlations, n_modes),
                "chains": {str(t): chain(correlations, n_modes, t) for t in CHAINED},
                "cosines": {str(t): from_cosines(correlations, n_modes, t) for t in ITERATIONS},
            }
            for n_modes in all_modes
        ],
        "encode_s": {method: each.wall for method, each in seconds.items()},
    }


def milliseconds(
    blocks: list[Floats], correlations: list[Floats], n_modes: int
) -> dict[str, float]:
    """Median time of every method for the basis of later blocks.

    Every method needs R; the others compute a basis from it.
    """
    numbers = range(1, min(len(blocks), 1 + TIMED_BLOCKS))
    starts = [eigen_trajectories(before, n_modes)[1] for before in correlations]

    def advance(n_iterations: int, number: int) -> Floats:
        return tracked(correlations[number], starts[number - 1], n_iterations)

    ways: dict[str, Callable[[int], Any]] = {
        "R": lambda number: autocorrelation(blocks[number]),
        "eigh": lambda number: eigen_trajectories(correlations[number], n_modes),
        "eigh, K only": lambda number: leading_only(correlations[number], n_modes),
        **{f"t = {n_iterations}": partial(advance, n_iterations) for n_iterations in ITERATIONS},
    }
    tasks = {f"{name}/{n}": partial(way, n) for name, way in ways.items() for n in numbers}
    runs = rounds(tasks, 30, budget_s=1.0)
    return {
        name: 1000 * median(run.wall for n in numbers for run in runs[f"{name}/{n}"])
        for name in ways
    }


def leading_only(correlation: Floats, n_modes: int) -> Floats:
    """Only the leading eigenvectors."""
    length = correlation.shape[-1]
    indices = (length - n_modes, length - 1)
    vectors = [eigh(axis, subset_by_index=indices)[1][:, ::-1] for axis in correlation]
    return fix_signs(np.stack(vectors))


def tracked(correlation: Floats, start: Floats, n_iterations: int) -> Floats:
    """The basis of a block as in method `blocks`, without quantization."""
    advanced = advance_basis(correlation, start, n_iterations)
    return align_basis(ritz_vectors(correlation, advanced), start)


def chain(correlations: list[Floats], n_modes: int, n_iterations: int) -> dict[str, float]:
    """Quality of bases tracked from the first block to the last."""
    _, basis = eigen_trajectories(correlations[0], n_modes)
    bases = [basis := tracked(matrix, basis, n_iterations) for matrix in correlations[1:]]
    return quality(correlations[1:], bases)


def from_cosines(correlations: list[Floats], n_modes: int, n_iterations: int) -> dict[str, float]:
    """Quality of bases if each starts from the first cosines."""
    cosines = idct(np.eye(correlations[0].shape[-1], n_modes), axis=0, norm="ortho")
    start, later = np.stack([cosines] * 3), correlations[1:]
    return quality(later, [tracked(matrix, start, n_iterations) for matrix in later])


def quality(correlations: list[Floats], bases: list[Floats]) -> dict[str, float]:
    """Median largest angle to the eigenvectors of a block, and excess of the projection error."""
    angles, left, least = [], 0.0, 0.0
    for correlation, basis in zip(correlations, bases, strict=True):
        _, best = eigen_trajectories(correlation, basis.shape[-1])
        angles += [subspace_angles(*pair)[0] for pair in zip(basis, best, strict=True)]
        left += residual_energy(correlation, basis)
        least += residual_energy(correlation, best)
    excess = 100 * (np.sqrt(left / least) - 1)
    return {"angle_deg": float(np.rad2deg(median(angles))), "excess_percent": float(excess)}


def residual_energy(correlation: Floats, basis: Floats) -> float:
    """Energy of a block outside the span of a basis."""
    projected = np.einsum("atk,ats,ask->", basis, correlation, basis, optimize=True)
    return float(np.trace(correlation, axis1=1, axis2=2).sum() - projected)


def print_basis(results: list[Figures]) -> None:
    """Print times of a basis, its quality, and times of whole encodings."""
    cases = [(labels(result, modes), modes) for result in results for modes in result["modes"]]
    ways = list(cases[0][1]["milliseconds"])
    times = (
        [*ends, *(f"{modes['milliseconds'][way]:.3g}" for way in ways)] for ends, modes in cases
    )
    print_table("Milliseconds for the basis of one block:", [*LABELS, "modes", *ways], times)
    header = [*map(str, CHAINED), f"t for {USEFUL_PERCENT:g} %",
              *(f"cosines, {t}" for t in ITERATIONS)]  # fmt: skip
    rows, encodings = [], []
    for ends, modes in cases:
        chains, cosines = modes["chains"], modes["cosines"].values()
        useful = [t for t, each in chains.items() if each["excess_percent"] <= USEFUL_PERCENT]
        cells = [f"{each['excess_percent']:.2f} ({each['angle_deg']:.2g})"
                 for each in chains.values()]  # fmt: skip
        first = useful[0] if useful else f"> {CHAINED[-1]}"
        rows.append([*ends, *cells, first, *(f"{each['excess_percent']:.2f}" for each in cosines)])
    print_table(
        "Error of projection above the least in %, and largest angle in degrees, after t from the "
        "block before; and the error from cosines:", [*LABELS, "modes", *header], rows,
    )  # fmt: skip
    for result in results:
        modes, seconds = result["modes"][-1], result["encode_s"]
        share = result["n_blocks"] * modes["milliseconds"]["eigh"] / 10 / seconds["pca-qp"]
        cells = [f"{seconds[method]:.3f}" for method in ("pca-qp", "blocks")]
        encodings.append([*labels(result, modes), *cells, f"{share:.1f}"])
    print_table(
        "Seconds of whole encodings, and the share of all bases of `pca-qp`:",
        [*LABELS, "modes", "pca-qp", "blocks", "bases %"], encodings,
    )  # fmt: skip


def own_basis(correlation: Floats, basis: Floats, n_iterations: int) -> Floats:
    """The leading eigenvectors, independent of the initial basis."""
    return eigen_trajectories(correlation, basis.shape[-1])[1]


def measure_bits(sequence: meshreel.MeshSequence, length: int, all_modes: list[int]) -> Figures:
    """Bytes and KG error of every variant with every number of modes and bits.

    Bytes of a file are without vertex order.
    """
    points = []
    for variant, choices in VARIANTS.items():
        is_decomposed = variant.startswith("eigh")
        patched = patch.object(pipeline, "advance_basis", own_basis)
        for n_modes, bits in ((n_modes, bits) for n_modes in all_modes for bits in BITS):
            options = {**choices, "block_frames": length, "n_modes": n_modes, "bits": bits}
            with patched if is_decomposed else nullcontext():
                data = meshreel.encode(sequence, order="vertices", **options)
            decoded = meshreel.decode(data).vertices
            point = {
                "variant": variant,
                "n_modes": n_modes,
                "bits": bits,
                "size_bytes": len(data) - meshreel.info(data).budget_bytes["order"],
                "basis_bytes": basis_bytes(data),
                "kg_percent": position_errors(sequence.vertices, decoded).kg_error_percent,
            }
            points.append(point)
    return {"points": points}


def basis_bytes(data: bytes) -> list[int]:
    """Bytes of the basis section of each block."""
    opened = whole_stream(data)
    groups = (dict(opened.group(number)) for number in range(opened.n_blocks))
    return [len(group[Section.BASIS]) for group in groups]


def print_bits(results: list[Figures]) -> None:
    """Print files at equal modes and bits, and rates at equal error."""
    sizes, rates = [], []
    for result in results:
        points: list[Figures] = result["points"]
        for n_modes in sorted({point["n_modes"] for point in points}):
            fresh, other = (
                next(
                    point
                    for point in points
                    if (point["variant"], point["n_modes"], point["bits"])
                    == (variant, n_modes, SHOWN_BITS)
                )
                for variant in ("fresh", SHOWN)
            )
            later, later_tracked = (np.mean(each["basis_bytes"][1:]) for each in (fresh, other))
            sizes.append(
                [
                    *labels(result), str(n_modes), f"{later:.0f}", f"{later_tracked:.0f}",
                    f"{change(later_tracked, later):+.1f}",
                    f"{100 * sum(fresh['basis_bytes']) / fresh['size_bytes']:.1f}",
                    f"{change(other['size_bytes'], fresh['size_bytes']):+.2f}",
                    f"{fresh['kg_percent']:.3f}", f"{other['kg_percent']:.3f}",
                ]
            )  # fmt: skip
        curves: dict[str, list[tuple[float, float]]] = {name: [] for name in VARIANTS}
        for point in points:
            curves[point["variant"]].append((point["size_bytes"], point["kg_percent"]))
        fresh_curve = curves.pop("fresh")
        percents = [bd_rate(curve, fresh_curve).percent for curve in curves.values()]
        cells = ("-" if percent is None else f"{percent:+.2f}" for percent in percents)
        rates.append([*labels(result), *cells])
    print_table(
        f"Equal modes, {SHOWN_BITS} bits, {SHOWN}; bases of all blocks but the first:",
        [*LABELS, "modes", "bytes of a basis, fresh", "tracked", "%", "bases, % of file",
         "file, %", "KG %, fresh", "tracked"], sizes,
    )  # fmt: skip
    print_table(
        "BD-rate against `fresh` in % at equal KG error, best of all modes and bits:",
        [*LABELS, *list(VARIANTS)[1:]], rates,
    )  # fmt: skip


def measure_reel(sequence: meshreel.MeshSequence, length: int, _: list[int]) -> Figures:
    """Bytes of the temporal bases, without cosines, and of the file, with and without blocks."""
    with patch.object(basis_coding, "MIN_COSINE_GAIN", 1.0):
        data = meshreel.encode(sequence, block_frames=length, order="drop")
        whole = meshreel.encode(sequence, order="drop")
    opened, bases = whole_stream(data), []
    for number in range(opened.n_blocks):
        payload = dict(opened.group(number))[Section.BASIS]
        n_modes, n_frames = opened.file.group(number).n_modes, opened.file.block(number).n_frames
        integers, order = np.empty((n_modes, 3 * n_frames), np.int32), time_order(3, n_frames)
        arguments = payload, n_modes, n_modes, *order, integers
        call("reel_fields_decode", *arguments, noun="basis", memory_of=order.memory_of)
        bases.append(integers.reshape(n_modes, 3, n_frames).astype(np.int64))
    differences = [subtract_similar(block, before) for before, block in pairwise(bases)]
    return {
        "size_bytes": len(data),
        "basis_bytes": basis_bytes(data),
        "difference_bytes": [len(write_basis(difference)) for difference in differences],
        "uncut_bytes": len(whole),
    }


def subtract_similar(block: Integers, previous: Integers) -> Integers:
    """Subtract from each mode the previous mode, of either sign, with the smallest residual."""
    rows, known = (modes.reshape(len(modes), -1) for modes in (block, previous))
    candidates = np.concatenate([np.zeros_like(known[:1]), known, -known])
    left = np.abs(rows[:, None] - candidates).sum(axis=2)
    return np.asarray((rows - candidates[left.argmin(axis=1)]).reshape(block.shape))


def print_reel(results: list[Figures]) -> None:
    """Print the share of the temporal bases, and the cost of blocks."""
    rows = []
    for result in results:
        size, basis = result["size_bytes"], result["basis_bytes"]
        parts = (basis, basis[1:], result["difference_bytes"])
        shares = (f"{100 * sum(part) / size:.1f}" for part in parts)
        above = f"{change(size, result['uncut_bytes']):+.0f}"
        rows.append([*labels(result), str(len(basis)), str(size), *shares, above])
    header = ["blocks", "file", "temporal bases, %", "in later blocks, %", "as differences, %",
              "file above uncut, %"]  # fmt: skip
    print_table("", [*LABELS, *header], rows)


LABELS = ("sequence", "block")


def labels(result: Figures, modes: Figures | None = None) -> list[str]:
    """The leading cells of a row."""
    ends = [result["sequence"], str(result["block_frames"])]
    return [*ends, str(modes["n_modes"])] if modes else ends


def change(value: float, reference: float) -> float:
    """Change in percent."""
    return 100 * (value / reference - 1)


PARTS: dict[str, tuple[Callable[..., Figures], Callable[[list[Figures]], None]]] = {
    "basis": (measure_basis, print_basis),
    "bits": (measure_bits, print_bits),
    "reel": (measure_reel, print_reel),
}


def looped(path: str) -> meshreel.MeshSequence:
    """The frames of a file, repeated: blocks of its length are identical."""
    once = meshreel.load(path)
    frames = once.vertices[[*range(once.n_frames)] * LOOPS]
    return meshreel.MeshSequence(frames, once.faces, once.fps, f"{once.name}, looped")


def cases(options: argparse.Namespace) -> Iterator[tuple[Source, list[int]]]:
    """Yield sequences and their block lengths."""
    for path in options.inputs:
        yield partial(meshreel.load, path), options.block_frames
    for n_frames in options.flag:
        yield partial(meshreel.simulate_flag, n_frames), options.block_frames
    for path in options.loop:
        yield partial(looped, path), [meshreel.load(path).n_frames]


def results(options: argparse.Namespace) -> Iterator[Figures]:
    """Yield measurements of every valid combination of sequence and block length."""
    measure, _ = PARTS[options.part]
    for source, lengths in cases(options):
        sequence = source()
        for length in lengths:
            n_blocks = sequence.n_frames // length
            n_modes = [count for count in options.modes if count < length]
            if n_blocks > 1 and n_modes:
                whole = first_frames(sequence, n_blocks * length)
                case = {"sequence": sequence.name, "block_frames": length, "n_blocks": n_blocks}
                with one_blas_thread():
                    yield {**case, **measure(whole, length, n_modes)}


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
    figures = list(results(options))
    print(f"{machine_text()}\n")
    PARTS[options.part][1](figures)
    store(options.out, part=options.part, results=figures)


if __name__ == "__main__":
    main()
