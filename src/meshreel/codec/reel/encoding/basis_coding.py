"""The encoder's choice of how basis vectors over time become integers, for each block.

Short, periodic and smooth motion takes fewer bits as cosines, long motion with sudden changes as
times that are predicted from those around, mostly with weights that adapt. docs/codec.md, "Adaptive
times" and "Cosines over time".

Rounding errors of the temporal basis change from frame to frame: a model that rests would seem to
crawl. So times at which it rests are predicted from the time before, with finer steps where these
are needed. docs/codec.md, "Rest".
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER, BlockFrames
from meshreel.codec.reel.normative.timeline import COARSEST
from meshreel.kernel.basis import (
    BY_TIMES,
    MAX_COSINES,
    MAX_REST_BITS,
    NO_REST,
    BasisCoding,
    Rests,
    encode_basis,
    quantized_basis,
)

Floats = npt.NDArray[np.float64]
Runs = tuple[tuple[int, int], ...]

SAMPLED_MODES = 48
"""Most modes that are tried in each coding: those in the middle."""

ERROR_WEIGHT = 0.5
"""Weight of errors in the estimated cost, in the bits that would remove them. With weight 1 the KG
error improves, but STED gets worse where cosines take more bits and leave smaller errors."""

MIN_COSINE_GAIN = 0.01
"""Share of the estimated cost that cosines have to save; the difference of two estimates is within
about 2 % of the bytes of a basis."""

MIN_ADAPTIVE_GAIN = 0.005
"""Share that adaptive times have to save: estimates of similar integers differ little."""

MIN_ADAPTIVE_FRAMES = 16
"""Fewer moving times teach the weights too little: blocks of 12 frames gained nothing."""

GROUP = 4
"""Integers of a column whose mean magnitude estimates their bits."""

MIN_RESTING = 0.5
"""Share of the vertices that rest at a resting time, of those that move at all in the block."""

MAX_COST_RATIO, MAX_COST_SHARE = 2.0, 0.01
"""A run of resting times is kept if it takes at most this many times the bits that the same times
take without it, or while all such runs together cost at most this share of the basis in extra
bits."""


def choose_coding(
    frames: BlockFrames, wanted: Floats, step: float, finer: float, price: float
) -> BasisCoding:
    """Return the coding of a block: cosines if nothing rests, or adaptive times, if they save bits.

    Parameters
    ----------
    frames, wanted, step, finer, price
        As in `find_rests`.
    """
    rests = find_rests(frames, wanted, step, finer, price)
    moving = wanted
    if rests.runs:
        moving = np.ascontiguousarray(wanted[:, :, rests.flags(wanted.shape[2]) == 0])
    return replace(cheapest_coding(moving, price, may_be_cosines=not rests.runs), rests=rests)


def cheapest_coding(wanted: Floats, price: float, *, may_be_cosines: bool = True) -> BasisCoding:
    """Return the coding of least estimated cost: bits, and the weighted bits of errors.

    Some consecutive modes are tried, because adaptive weights carry over from mode to mode.

    Parameters
    ----------
    wanted : float64 array of shape (K, C, T)
        Basis vectors, in steps.
    price : float
        Squared steps that a bit is worth; 0 compares bits alone.
    """
    n_modes, _, n_frames = wanted.shape
    first = max(0, (n_modes - SAMPLED_MODES) // 2)
    some = wanted[first : first + SAMPLED_MODES]
    plain = _cost(some, price, BY_TIMES)
    largest = math.sqrt(n_frames) * float(np.abs(wanted).max(initial=0.0))  # of a coefficient
    if may_be_cosines and n_frames <= MAX_COSINES and largest < LARGEST_INTEGER:
        cosines = BasisCoding(has_cosines=True)
        if _cost(some, price, cosines) < (1.0 - MIN_COSINE_GAIN) * plain:
            return cosines
    if n_frames >= MIN_ADAPTIVE_FRAMES:
        adaptive = BasisCoding(is_adaptive=True)
        if _cost(some, price, adaptive) < (1.0 - MIN_ADAPTIVE_GAIN) * plain:
            return adaptive
    return BY_TIMES


def _cost(wanted: Floats, price: float, coding: BasisCoding) -> float:
    """Return estimated bits of basis vectors, and the weighted bits that would remove their error.

    Bits are estimated separately for each level of times.
    """
    coded, decoded = quantized_basis(wanted, price, coding, np.ones(len(wanted)))
    levels = [slice(0, None, COARSEST), slice(2, None, COARSEST), slice(1, None, 2)]
    if coding.has_cosines:
        levels = [slice(None)]
    squared_error = float(np.square(np.moveaxis(decoded, 2, 0) - wanted).sum())
    bits = 0.0
    for level in levels:
        bits += _estimated_bits(coded[:, :, level])
    return bits + (ERROR_WEIGHT * squared_error / price if price else 0.0)


def _estimated_bits(integers: npt.NDArray[np.int32]) -> float:
    """Return estimated bits of integers (K, C, n), geometrically distributed in each group."""
    n = integers.shape[2]
    if not n:
        return 0.0
    starts = np.arange(0, n, GROUP)
    counts = np.diff(starts, append=n)
    mean = np.add.reduceat(np.abs(integers.astype(np.float64)), starts, axis=2) / counts
    magnitudes = np.log2(1.0 + mean) + mean * np.log2(1.0 + 1.0 / np.maximum(mean, 1e-300))
    return float(((magnitudes + mean / (1.0 + mean)) * counts).sum())


def find_rests(
    frames: BlockFrames, wanted: Floats, step: float, finer: float, price: float
) -> Rests:
    """Return the resting times of a block, and the precision of their integers.

    A vertex rests if it moves by less than a quantization step. A time rests if most vertices do,
    unless this takes many more bits, for example where the others move a lot.

    Parameters
    ----------
    frames : BlockFrames
    wanted : float64 array of shape (K, C, T)
        Basis vectors of the block, in steps.
    step : float
        Step of the fields, in diagonals.
    finer : float
        Step of the temporal basis divided by that of the fields, both as they act on positions.
    price : float
        Squared steps that a bit is worth.
    """
    position_step = step / math.sqrt(frames.n_frames)
    steps, ranges = frames.sampled_motion
    steps = steps[:, ranges >= position_step]
    if not steps.size:
        return NO_REST
    share = np.mean(steps < position_step, axis=1)
    runs = _runs_of(np.concatenate([[False], share >= MIN_RESTING]))
    if not runs:
        return NO_REST
    found = Rests(runs, _rest_bits(frames.n_verts, wanted, finer))
    with_rests = encode_basis(wanted, price, BasisCoding(found))
    without = encode_basis(wanted, price)
    kept = _affordable(runs, _bits_of_times(with_rests), _bits_of_times(without))
    return Rests(kept, found.bits) if kept else NO_REST


def _affordable(runs: Runs, bits: Floats, bits_without: Floats) -> Runs:
    """Return the runs that are kept; see `MAX_COST_RATIO`."""
    costs = [(bits[start:end].sum(), bits_without[start:end].sum()) for start, end in runs]
    left, kept = MAX_COST_SHARE * bits_without.sum(), []
    for (cost, cost_without), run in sorted(zip(costs, runs, strict=True), key=_extra_bits):
        if cost <= MAX_COST_RATIO * cost_without:
            kept.append(run)
        elif cost - cost_without <= left:
            left -= cost - cost_without
            kept.append(run)
    return tuple(sorted(kept))


def _extra_bits(priced: tuple[tuple[float, float], tuple[int, int]]) -> float:
    (cost, cost_without), _ = priced
    return cost - cost_without


def _runs_of(is_resting: npt.NDArray[np.bool_]) -> Runs:
    """Return first time and end of each run; the first time of the block does not rest."""
    edges = np.flatnonzero(np.diff(is_resting.astype(np.int8), append=0)) + 1
    return tuple(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _rest_bits(n_verts: int, wanted: Floats, finer: float) -> int:
    """Return the precision with which rounding moves a vertex by one step (RMS) per frame.

    An integer of a basis vector moves V vertices by finer sqrt(T / V) steps, RMS. A frame has K C
    of them with independent errors of 1 / sqrt(12) each, and so has the frame before.
    """
    n_modes, n_columns, n_frames = wanted.shape
    moved = finer * math.sqrt(n_frames / n_verts * n_modes * n_columns / 6.0)
    most = LARGEST_INTEGER / (2.0 * max(1.0, float(np.abs(wanted).max())))
    bits = min(round(math.log2(moved)), math.floor(math.log2(most)))
    return int(np.clip(bits, 0, MAX_REST_BITS))


def _bits_of_times(integers: npt.NDArray[np.int32]) -> Floats:
    """Return estimated bits of integers (K, C, T) for each time, without those of zeros."""
    return np.asarray(2.0 * np.log2(1.0 + np.abs(integers.astype(np.float64))).sum(axis=(0, 1)))
