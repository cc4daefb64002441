"""Runs that measure the paper's variants, and the paper's count of bits (Table I, paper Eq. 13).

The count is of one coordinate matrix of three, without connectivity, means and headers, so it is
comparable only with the paper's tables. Letters as in the paper: n vertices, k frames, n_c anchors,
n_b blocks of k_f frames.
"""

import io
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import StreamInfo, info
from meshreel.evaluation.runs.store import Outcome, Run, finite
from meshreel.evaluation.runs.timing import (
    REPEATS,
    machine_facts,
    processor_seconds_of,
    timed_on_both_clocks,
)
from meshreel.metrics.compare import compare
from meshreel.model.sequence import MeshSequence
from meshreel.paper.decoder import bits_per_row, coded_blocks
from meshreel.paper.pipeline import CodedBlock
from meshreel.paper.sweeps import Setting
from meshreel.runtime.progress import Progress

MEASURED = (
    "wall-clock and processor seconds (all threads) in one process, from arrays in memory to bytes "
    "in memory and back, with connectivity and entropy coding, without files; the order of "
    "vertices and faces is preserved"
)

DICTIONARY_BITS = 16  # per entry of a dictionary that is coded whole
Count = dict[str, float | None]


def variant_run(
    sequence: MeshSequence, setting: Setting, *, shown_frame: int = 0, repeat: bool = False
) -> Run:
    """A run of a setting; its stream and one decoded frame are stored with the result.

    The sequence is encoded once with vertex order, for quality and seconds, and once without, for
    the smallest size.

    Parameters
    ----------
    shown_frame : int
        The decoded frame to store for pictures.
    repeat : bool
        Use the median of three runs if one takes less than two seconds.
    """
    modes = setting.n_modes or "default"

    def measure(progress: Progress) -> Outcome:
        return _measure(sequence, setting, shown_frame, REPEATS if repeat else 1, progress)

    return Run(
        name=f"{setting.label}, {modes} modes, {setting.bits} bits",
        key=setting.key,
        setting=asdict(setting),
        measure=measure,
        needs=("reel",),
    )


def _measure(
    sequence: MeshSequence, setting: Setting, shown_frame: int, n_repeats: int, progress: Progress
) -> Outcome:
    options = setting.options()
    data, *encode_s = timed_on_both_clocks(
        lambda: encode(sequence, **options, progress=progress), n_repeats
    )
    decoded, *decode_s = timed_on_both_clocks(lambda: decode(data, progress=progress), n_repeats)
    smallest = info(encode(sequence, **options, order="drop", progress=progress))
    stream = info(data)
    frame = io.BytesIO()
    np.save(frame, decoded.vertices[shown_frame])
    figures = {
        "stream": stream.as_dict(),
        "rate_bpvf": stream.rate_bpvf,
        "rate_order_dropped_bpvf": smallest.rate_bpvf,
        "size_order_dropped_bytes": smallest.size_bytes,
        "budget_order_dropped_bytes": smallest.budget_bytes,
        "paper_count": paper_count(setting, stream, coded_blocks(data)),
        "bits_per_row": [rows.tolist() for rows in bits_per_row(data)],
        "seconds": {**processor_seconds_of(encode_s, decode_s), "measured": MEASURED},
        "quality": finite(compare(sequence, decoded, progress=progress).as_dict()),
        "machine": machine_facts(),
    }
    return Outcome(figures, {"reel": data, "npy": frame.getvalue()})


def paper_count(setting: Setting, stream: StreamInfo, blocks: Sequence[CodedBlock]) -> Count:
    """Compute the paper's q, q_a, q_d and q_s of a stream; None for parts that a method lacks.

    q and q_a are a third of the bits of coefficients and anchors in the stream, over n k. q_d is
    the formula of Eq. 13 with 16 bits, for dictionaries of k x k; for `blocks` the bits of an entry
    are the mean of those in the stream, and q_d is given as printed and as stored.

    Returns
    -------
    dict of bits per vertex and frame: "q"; "q_fixed", without entropy coding, at the bits of the
    largest coefficient of each row; "q_a"; "q_a_printed", 16 bits for each position as the paper
    assumes; "q_d"; "q_d_as_stored"; "q_s", the sum of q, q_a and q_d; and "dictionary_bits" per
    entry
    """
    n_verts, n_frames = stream.n_verts, stream.n_frames
    budget = stream.budget_bytes

    def stream_bpvf(*parts: str) -> float:
        bits = 8 * sum(budget.get(part, 0) for part in parts) / 3
        return paper_coefficients_bpvf(bits, n_verts, n_frames)

    q = stream_bpvf("coefficients")
    q_a = printed_a = None
    if setting.anchors > 0:
        q_a = stream_bpvf("anchors", "anchor residuals")
        printed_a = paper_anchors_bpvf(_n_anchors(blocks[0]), n_verts)
    bits = _dictionary_bits(setting, stream, blocks)
    printed = stored = None
    if bits is not None:
        sizes = len(blocks), max(stream.block_frames), n_verts, n_frames
        printed = paper_dictionary_bpvf_as_printed(*sizes, bits=bits)
        stored = paper_dictionary_bpvf_as_stored(*sizes, bits=bits)
    return {
        "q": q,
        "q_fixed": fixed_length_bits(blocks) / 3 / (n_verts * n_frames),
        "q_a": q_a,
        "q_a_printed": printed_a,
        "q_d": printed,
        "q_d_as_stored": stored,
        "q_s": q + (q_a or 0) + (printed or 0),
        "dictionary_bits": bits,
    }


def fixed_length_bits(blocks: Sequence[CodedBlock]) -> float:
    """Bits of all coefficients if each row had the bits of its largest integer and a sign."""
    total = 0.0
    for block in blocks:
        largest = np.abs(block.coefficients.integers).max(axis=2)
        bits = np.where(largest > 0, np.frexp(largest.astype(float))[1] + 1, 0)
        total += float(bits.sum()) * block.coefficients.integers.shape[2]
    return total


def _n_anchors(block: CodedBlock) -> int:
    if block.anchors is None:
        return 0
    if block.anchors.residuals is not None:
        return int(block.anchors.residuals.integers.shape[1])
    assert block.anchors.coefficients is not None
    return int(block.anchors.coefficients.integers.shape[2])


def _dictionary_bits(
    setting: Setting, stream: StreamInfo, blocks: Sequence[CodedBlock]
) -> float | None:
    """Bits per entry of the dictionary; None without one (`gft` does not code it)."""
    n_entries = sum(block.basis.integers.size for block in blocks if block.basis is not None)
    if n_entries == 0:
        return None
    if setting.method != "blocks":
        return DICTIONARY_BITS
    return 8 * stream.budget_bytes["basis"] / n_entries


def paper_coefficients_bpvf(coefficient_bits: float, n_verts: int, n_frames: int) -> float:
    """The paper's q: all coefficient bits of one coordinate, over n k.

    Parameters
    ----------
    coefficient_bits : float
        Total bits of the coefficients of one coordinate. If every coefficient takes the same
        number of bits, q is that number.
    """
    return coefficient_bits / (n_verts * n_frames)


def paper_anchors_bpvf(n_anchors: int, n_verts: int, *, bits: float = 16) -> float:
    """The paper's q_a of one coordinate, ``bits n_c k / (n k)``; the frames cancel."""
    return bits * n_anchors / n_verts


def paper_dictionary_bpvf_as_printed(
    n_blocks: int, block_frames: int, n_verts: int, n_frames: int, *, bits: float = 16
) -> float:
    """The paper's q_d as printed, ``bits n_b^2 k_f^2 / (n k)``.

    With blocks that fill the sequence this is ``bits k / n`` for any number of them: the cost
    of one k x k dictionary, as in the paper's tables for a single block.
    """
    return bits * n_blocks**2 * block_frames**2 / (n_verts * n_frames)


def paper_dictionary_bpvf_as_stored(
    n_blocks: int, block_frames: int, n_verts: int, n_frames: int, *, bits: float = 16
) -> float:
    """The paper's q_d for the stored dictionaries, ``bits n_b k_f^2 / (n k)``.

    Each of the n_b blocks has one k_f x k_f dictionary. Equal to the printed form for one block.
    """
    # Deviation from Eq. 13: it prints n_b^2, but storage grows with n_b.
    return bits * n_blocks * block_frames**2 / (n_verts * n_frames)
