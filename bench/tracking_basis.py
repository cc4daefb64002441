"""Time and quality of the basis of one block: by decomposition, or tracked."""

from collections.abc import Mapping
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.fft import idct
from scipy.linalg import eigh, subspace_angles

import meshreel
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories, fix_signs
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.paper.subspace.orthogonal_iteration import advance_basis, align_basis, ritz_vectors
from speed_tables import table
from speed_timing import Patience, Tasks, timed_in_turn

Floats = npt.NDArray[np.float64]

TIMED_BLOCKS = 3
PATIENCE = Patience(most_rounds=30, budget_s=1.0)
ITERATIONS = (1, 2, 4)
CHAINED = (0, 1, 2, 4, 8, 16)
USEFUL_PERCENT = 1.0
"""Largest excess error, in percent, of a useful tracked basis."""


def measured(sequence: meshreel.MeshSequence, length: int, all_modes: list[int]) -> dict[str, Any]:
    """Milliseconds and quality for every number of modes, and the seconds of whole encodings."""
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.extent))
    blocks = np.split(matrices, sequence.n_frames // length, axis=1)
    correlations = [autocorrelation(block) for block in blocks]
    return {
        "modes": [
            {
                "n_modes": n_modes,
                "milliseconds": milliseconds(blocks, correlations, n_modes),
                "chains": {str(t): chain(correlations, n_modes, t) for t in CHAINED},
                "from_cosines": {
                    str(t): from_cosines(correlations, n_modes, t) for t in ITERATIONS
                },
            }
            for n_modes in all_modes
        ],
        "encode_s": encode_seconds(sequence, length, all_modes[-1]),
    }


def milliseconds(
    blocks: list[Floats], correlations: list[Floats], n_modes: int
) -> dict[str, float]:
    """Median time of every method for the basis of later blocks, in alternating rounds."""
    tasks = {
        str(number): ways(blocks[number], correlations[number - 1], correlations[number], n_modes)
        for number in range(1, min(len(blocks), 1 + TIMED_BLOCKS))
    }
    runs = timed_in_turn(tasks, PATIENCE)
    names = next(iter(tasks.values()))
    return {
        name: 1000 * median(time for own in runs.values() for time in own[name]) for name in names
    }


def ways(block: Floats, before: Floats, correlation: Floats, n_modes: int) -> Tasks:
    """Tasks: the computation of R, which every method needs, and methods from R to a basis."""
    _, start = eigen_trajectories(before, n_modes)
    found: Tasks = {
        "R": partial(autocorrelation, block),
        "eigh": partial(eigen_trajectories, correlation, n_modes),
        "eigh, K only": partial(leading_only, correlation, n_modes),
    }
    for n_iterations in ITERATIONS:
        found[f"t = {n_iterations}"] = partial(tracked, correlation, start, n_iterations)
    return found


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
    """Quality of bases tracked from the first block to the last.

    Returns
    -------
    dict with
        "angle_deg": median over blocks and axes of the largest angle to the true subspace;
        "excess_percent": increase of the projection error of later blocks relative to their
        eigenvectors.
    """
    _, basis = eigen_trajectories(correlations[0], n_modes)
    bases = [basis := tracked(matrix, basis, n_iterations) for matrix in correlations[1:]]
    return quality(correlations[1:], bases)


def from_cosines(correlations: list[Floats], n_modes: int, n_iterations: int) -> dict[str, float]:
    """Quality of bases if each starts from the first cosines; as `chain`."""
    length = correlations[0].shape[-1]
    cosines = idct(np.eye(length, n_modes), axis=0, norm="ortho")
    start = np.stack([cosines] * 3)
    return quality(
        correlations[1:], [tracked(matrix, start, n_iterations) for matrix in correlations[1:]]
    )


def quality(correlations: list[Floats], bases: list[Floats]) -> dict[str, float]:
    """Angle to the eigenvectors of each block, and excess of the error; see `chain`."""
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


def encode_seconds(sequence: meshreel.MeshSequence, length: int, n_modes: int) -> dict[str, float]:
    """Median seconds of complete encodings with both bases, in alternating rounds."""
    tasks: dict[str, Tasks] = {
        method: {
            "encode": partial(
                meshreel.encode,
                sequence,
                method=method,
                block_frames=length,
                n_modes=n_modes,
                order="drop",
            )
        }
        for method in ("pca-qp", "blocks")
    }
    runs = timed_in_turn(tasks, Patience(most_rounds=5, budget_s=3.0))
    return {method: median(own["encode"]) for method, own in runs.items()}


def tables(results: list[dict[str, Any]]) -> str:
    """Times of a basis, its quality, and times of whole encodings."""
    ways_timed = list(results[0]["modes"][0]["milliseconds"])
    counts = list(map(str, CHAINED))
    from_others = [f"cosines, {t}" for t in ITERATIONS]
    ends = ["sequence", "block", "modes"]
    useful = f"t for {USEFUL_PERCENT:g} %"
    parts = [
        "Milliseconds for the basis of one block:",
        table([*ends, *ways_timed], (time_row(*case, ways_timed) for case in each(results))),
        "Error of projection above the least in %, and largest angle in degrees, after t from "
        "the block before; and the error from cosines:",
        table([*ends, *counts, useful, *from_others], (chain_row(*case) for case in each(results))),
        "Seconds of whole encodings, and the share of all bases of `pca-qp`:",
        table([*ends, "pca-qp", "blocks", "bases %"], map(encode_row, results)),
    ]
    return "\n\n".join(parts)


def each(results: list[dict[str, Any]]) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Every combination of case and number of modes."""
    return [(result, modes) for result in results for modes in result["modes"]]


def labels(result: Mapping[str, Any], modes: Mapping[str, Any]) -> list[str]:
    """The leading cells of a row."""
    return [result["sequence"], str(result["block_frames"]), str(modes["n_modes"])]


def time_row(
    result: Mapping[str, Any], modes: Mapping[str, Any], ways_timed: list[str]
) -> list[str]:
    """Milliseconds of every method."""
    return [*labels(result, modes), *(f"{modes['milliseconds'][way]:.3g}" for way in ways_timed)]


def chain_row(result: Mapping[str, Any], modes: Mapping[str, Any]) -> list[str]:
    """Quality by number of iterations, and the smallest useful number."""
    chains = modes["chains"]
    cells = [f"{one['excess_percent']:.2f} ({one['angle_deg']:.2g})" for one in chains.values()]
    useful = [t for t, one in chains.items() if one["excess_percent"] <= USEFUL_PERCENT]
    first = useful[0] if useful else f"> {CHAINED[-1]}"
    cosines = (f"{one['excess_percent']:.2f}" for one in modes["from_cosines"].values())
    return [*labels(result, modes), *cells, first, *cosines]


def encode_row(result: Mapping[str, Any]) -> list[str]:
    """Seconds of both methods."""
    modes, seconds = result["modes"][-1], result["encode_s"]
    bases_s = result["n_blocks"] * modes["milliseconds"]["eigh"] / 1000
    cells = (f"{seconds[method]:.3f}" for method in ("pca-qp", "blocks"))
    return [*labels(result, modes), *cells, f"{100 * bases_s / seconds['pca-qp']:.1f}"]
