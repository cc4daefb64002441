"""Bits of files with tracked bases, relative to files that decompose each block."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any
from unittest.mock import patch

import numpy as np
import numpy.typing as npt

import meshreel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.encoding import basis_coding
from meshreel.codec.reel.normative.blocks import write_basis
from meshreel.codec.reel.normative.timeline import time_order
from meshreel.codec.subspace.pca import eigen_trajectories
from meshreel.evaluation.rate_distortion import bd_rate
from meshreel.kernel.fields import decode_fields
from meshreel.metrics.kg import kg_error_percent
from meshreel.paper import pipeline
from speed_tables import table

Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

BITS = (8, 9, 10)
SHOWN_BITS = 9

VARIANTS: dict[str, dict[str, Any]] = {
    "fresh": {"method": "pca-qp"},
    "t = 1": {"method": "blocks", "n_iterations": 1},
    "t = 2": {"method": "blocks", "n_iterations": 2},
    "t = 4": {"method": "blocks", "n_iterations": 4},
    "eigh, differences": {"method": "blocks"},
}
TRACKED = list(VARIANTS)[1:]
SHOWN = "t = 4"


@contextmanager
def decomposed(variant: str) -> Iterator[None]:
    """Patch `blocks` to decompose each block, for the variant of this name."""
    if not variant.startswith("eigh"):
        yield
        return
    with patch.object(pipeline, "advance_basis", own_basis):
        yield


def own_basis(correlation: Floats, basis: Floats, n_iterations: int) -> Floats:
    """The leading eigenvectors, independent of the initial basis."""
    return eigen_trajectories(correlation, basis.shape[-1])[1]


def measured(sequence: meshreel.MeshSequence, length: int, all_modes: list[int]) -> dict[str, Any]:
    """Bytes and KG error of every variant with every number of modes and bits."""
    points = []
    for variant, choices in VARIANTS.items():
        with decomposed(variant):
            for n_modes in all_modes:
                for bits in BITS:
                    options = {**choices, "block_frames": length, "n_modes": n_modes, "bits": bits}
                    setting = {"variant": variant, "n_modes": n_modes, "bits": bits}
                    points.append({**setting, **point(sequence, options)})
    return {"points": points}


def point(sequence: meshreel.MeshSequence, options: dict[str, Any]) -> dict[str, Any]:
    """Bytes of a file without vertex order, bytes of the basis of each block, and KG error."""
    data = meshreel.encode(sequence, order="vertices", **options)
    decoded = meshreel.decode(data)
    return {
        "size_bytes": len(data) - meshreel.info(data).budget_bytes["order"],
        "basis_bytes": basis_bytes(data),
        "kg_percent": kg_error_percent(sequence.vertices, decoded.vertices),
    }


def basis_bytes(data: bytes) -> list[int]:
    """Bytes of the basis section of each block."""
    opened = whole_stream(data)
    groups = (dict(opened.group(number)) for number in range(opened.n_blocks))
    return [len(group[Section.BASIS]) for group in groups]


def measured_reel(
    sequence: meshreel.MeshSequence, length: int, all_modes: list[int]
) -> dict[str, Any]:
    """Bytes of the temporal bases, without cosines, and of the file, with and without blocks."""
    with patch.object(basis_coding, "MIN_COSINE_GAIN", 1.0):
        data = meshreel.encode(sequence, block_frames=length, order="drop")
        whole = meshreel.encode(sequence, order="drop")
    return {
        "size_bytes": len(data),
        "basis_bytes": basis_bytes(data),
        "difference_bytes": list(map(len, map(write_basis, differences(temporal_bases(data))))),
        "uncut_bytes": len(whole),
    }


def temporal_bases(data: bytes) -> list[Integers]:
    """Residuals of the temporal basis of each block of `reel`, of shape (K, 3, T)."""
    opened, found = whole_stream(data), []
    for number in range(opened.n_blocks):
        basis, n_modes = (
            dict(opened.group(number))[Section.BASIS],
            opened.file.group(number).n_modes,
        )
        n_frames = opened.file.block(number).n_frames
        integers = decode_fields(basis, n_modes, 3 * n_frames, time_order(3, n_frames))
        found.append(integers.reshape(n_modes, 3, n_frames).astype(np.int64))
    return found


def differences(blocks: list[Integers]) -> list[Integers]:
    """Time vectors of later blocks minus the most similar vectors of the previous block."""
    return [subtract_similar(block, before) for before, block in pairwise(blocks)]


def subtract_similar(block: Integers, previous: Integers) -> Integers:
    """Subtract from each mode the previous mode, of either sign, with the smallest residual."""
    rows, known = (modes.reshape(len(modes), -1) for modes in (block, previous))
    candidates = np.concatenate([np.zeros_like(known[:1]), known, -known])
    left = np.abs(rows[:, None] - candidates).sum(axis=2)
    return np.asarray((rows - candidates[left.argmin(axis=1)]).reshape(block.shape))


def tables(results: list[dict[str, Any]]) -> str:
    """Files at equal modes and bits, and rates at equal error."""
    at_equal = [
        "sequence", "block", "modes", "bytes of a basis, fresh", "tracked", "%", "bases, % of file",
        "file, %", "KG %, fresh", "tracked",
    ]  # fmt: skip
    pairs = [(result, n_modes) for result in results for n_modes in modes_of(result)]
    return "\n\n".join(
        [
            f"Equal modes, {SHOWN_BITS} bits, {SHOWN}; bases of all blocks but the first:",
            table(at_equal, (size_row(*pair) for pair in pairs)),
            "BD-rate against `fresh` in % at equal KG error, best of all modes and bits:",
            table(["sequence", "block", *TRACKED], map(rate_row, results)),
        ]
    )


def modes_of(result: Mapping[str, Any]) -> list[int]:
    """The measured numbers of modes."""
    return sorted({point["n_modes"] for point in result["points"]})


def size_row(result: Mapping[str, Any], n_modes: int) -> list[str]:
    """A file with tracked bases compared with one with decomposed bases."""
    fresh, tracked = (
        next(
            run
            for run in result["points"]
            if (run["variant"], run["n_modes"], run["bits"]) == (variant, n_modes, SHOWN_BITS)
        )
        for variant in ("fresh", SHOWN)
    )
    later, later_tracked = (np.mean(run["basis_bytes"][1:]) for run in (fresh, tracked))
    return [
        *labels(result),
        str(n_modes),
        f"{later:.0f}",
        f"{later_tracked:.0f}",
        f"{change(later_tracked, later):+.1f}",
        f"{100 * sum(fresh['basis_bytes']) / fresh['size_bytes']:.1f}",
        f"{change(tracked['size_bytes'], fresh['size_bytes']):+.2f}",
        f"{fresh['kg_percent']:.3f}",
        f"{tracked['kg_percent']:.3f}",
    ]


def rate_row(result: Mapping[str, Any]) -> list[str]:
    """BD-rates of every tracked variant."""
    curves = {
        variant: [
            (run["size_bytes"], run["kg_percent"])
            for run in result["points"]
            if run["variant"] == variant
        ]
        for variant in VARIANTS
    }
    rates = (bd_rate(curves[variant], curves["fresh"]).percent for variant in TRACKED)
    return [*labels(result), *("-" if rate is None else f"{rate:+.2f}" for rate in rates)]


def reel_table(results: list[dict[str, Any]]) -> str:
    """The share of the temporal bases, and the cost of blocks."""
    header = ["sequence", "block", "blocks", "file", "temporal bases, %", "in later blocks, %",
              "as differences, %", "file above uncut, %"]  # fmt: skip
    return table(header, map(reel_row, results))


def reel_row(result: Mapping[str, Any]) -> list[str]:
    """Shares of a file of `reel` with blocks."""
    size, basis = result["size_bytes"], result["basis_bytes"]
    return [
        *labels(result),
        str(len(basis)),
        str(size),
        f"{100 * sum(basis) / size:.1f}",
        f"{100 * sum(basis[1:]) / size:.1f}",
        f"{100 * sum(result['difference_bytes']) / size:.1f}",
        f"{change(size, result['uncut_bytes']):+.0f}",
    ]


def labels(result: Mapping[str, Any]) -> list[str]:
    """The leading cells of a row."""
    return [result["sequence"], str(result["block_frames"])]


def change(value: float, reference: float) -> float:
    """Change in percent."""
    return 100 * (value / reference - 1)
