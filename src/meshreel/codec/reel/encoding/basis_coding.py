"""Choice of the coding of basis vectors over time, for each block.

Short, periodic and smooth motion takes fewer bits as cosines; long motion with sudden changes, as
values that are predicted from adjacent times, mostly with adaptive weights. docs/codec.md,
"Adaptive times" and "Cosines over time".

Rounding errors of the temporal basis change in each frame, so a resting model would visibly crawl.
Times of rest are therefore predicted from the previous time, with finer steps if necessary.
docs/codec.md, "Rest".
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER, BlockFrames
from meshreel.kernel.basis import (
    BY_TIMES,
    MAX_COSINES,
    MAX_REST_BITS,
    NO_REST,
    TIME_STRIDE,
    BasisCoding,
    Rests,
    quantized_basis,
)

SAMPLED_MODES = 48
"""Maximum number of modes for comparing codings; the middle ones are taken."""

ERROR_WEIGHT = 0.5
"""Weight, in the estimated cost, of the bits that would remove errors. With weight 1 the KG error
improves, but STED gets worse if cosines take more bits and have smaller errors."""

MIN_COSINE_GAIN = 0.01
"""Share of the estimated cost that cosines must save; the difference of two estimates is correct
within about 2 % of the bytes of a basis."""

MIN_ADAPTIVE_GAIN = 0.005
"""Share of the estimated cost that adaptive times must save; estimates of similar integers are
similarly wrong."""

MIN_ADAPTIVE_FRAMES = 16
"""With fewer moving times, weights adapt too little: blocks of 12 frames gained nothing."""

GROUP = 4
"""Number of consecutive integers whose bits are estimated from their mean magnitude."""

MIN_RESTING = 0.5
"""Minimum share of vertices at rest at a resting time, among those that move in the block."""

MAX_COST_RATIO, MAX_COST_SHARE = 2.0, 0.01
"""A run of resting times is kept if it takes at most this many times the bits of the same times
without rest, or while the extra bits of all such runs are at most this share of the basis."""


def choose_coding(
    frames: BlockFrames, targets: Floats, step: float, finer: float, rate_weight: float
) -> BasisCoding:
    """Return the coding of a block: cosines if nothing rests, or adaptive times, if they save bits.

    Parameters
    ----------
    frames, targets, step, finer, rate_weight
        As in `find_rests`.
    """
    rests = find_rests(frames, targets, step, finer, rate_weight)
    moving = targets
    if rests.runs:
        moving = np.ascontiguousarray(targets[:, :, rests.flags(targets.shape[2]) == 0])
    return replace(cheapest_coding(moving, rate_weight, may_be_cosines=not rests.runs), rests=rests)


def cheapest_coding(
    targets: Floats, rate_weight: float, *, may_be_cosines: bool = True
) -> BasisCoding:
    """Return the coding of least estimated cost: bits, and the weighted bits of errors.

    A sample of consecutive modes is compared, because adaptive weights carry over between modes.

    Parameters
    ----------
    targets : float64 array of shape (K, C, T)
        Basis vectors, in steps.
    rate_weight : float
        As in `FieldChoices`; 0 compares only bits.
    """
    n_modes, _, n_frames = targets.shape
    first = max(0, (n_modes - SAMPLED_MODES) // 2)
    sample = targets[first : first + SAMPLED_MODES]
    largest = math.sqrt(n_frames) * float(np.abs(targets).max(initial=0.0))  # possible coefficient
    least_gains = {}
    if may_be_cosines and n_frames <= MAX_COSINES and largest < LARGEST_INTEGER:
        least_gains[BasisCoding(has_cosines=True)] = MIN_COSINE_GAIN
    if n_frames >= MIN_ADAPTIVE_FRAMES:
        least_gains[BasisCoding(is_adaptive=True)] = MIN_ADAPTIVE_GAIN
    plain = _cost(sample, rate_weight, BY_TIMES)
    for coding, least_gain in least_gains.items():
        if _cost(sample, rate_weight, coding) < (1.0 - least_gain) * plain:
            return coding
    return BY_TIMES


def _cost(targets: Floats, rate_weight: float, coding: BasisCoding) -> float:
    """Return estimated bits of basis vectors, and the weighted bits that would remove their error.

    Integers are geometrically distributed in each group.
    """
    coded, decoded = quantized_basis(targets, rate_weight, coding, np.ones(len(targets)))
    squared_error = float(np.square(decoded.transpose(2, 0, 1) - targets).sum())
    order, starts, counts = _groups(targets.shape[2], coding.has_cosines)
    mean = np.add.reduceat(np.abs(coded[:, :, order].astype(np.float64)), starts, axis=2) / counts
    bits = float((geometric_bits(mean) * counts).sum())
    return bits + (ERROR_WEIGHT * squared_error / rate_weight if rate_weight else 0.0)


def geometric_bits(mean: Floats) -> Floats:
    """Return the bits of an integer with geometrically distributed magnitude, given its mean."""
    magnitudes = np.log2(1.0 + mean) + mean * np.log2(1.0 + 1.0 / np.maximum(mean, 1e-300))
    return np.asarray(magnitudes + mean / (1.0 + mean))


@lru_cache(maxsize=8)
def _groups(n_frames: int, has_cosines: bool) -> tuple[Integers, Integers, Integers]:
    """Return the indices of a column's integers by group, and the start and size of each group.

    All integers of a group belong to one level of times.
    """
    times = np.arange(n_frames)
    levels = [times] if has_cosines else [times[::TIME_STRIDE], times[2::TIME_STRIDE], times[1::2]]
    sizes = [min(GROUP, len(level) - i) for level in levels for i in range(0, len(level), GROUP)]
    counts = np.array(sizes, np.int64)
    return np.concatenate(levels), np.cumsum(counts) - counts, counts


def find_rests(
    frames: BlockFrames, targets: Floats, step: float, finer: float, rate_weight: float
) -> Rests:
    """Return the resting times of a block, and the precision of their integers.

    A vertex rests if it moves by less than a quantization step. A time rests if most vertices do,
    unless this takes many more bits, for example where the others move a lot.

    Parameters
    ----------
    targets : float64 array of shape (K, C, T)
        Basis vectors of the block, in steps.
    step : float
        Step of the fields, in diagonals.
    finer : float
        Step of the temporal basis divided by that of the fields, both as they act on positions.
    rate_weight : float
        As in `FieldChoices`.
    """
    position_step = step / math.sqrt(frames.n_frames)
    steps, ranges = frames.sampled_motion
    steps = steps[:, ranges >= position_step]
    if not steps.size:
        return NO_REST
    is_resting = np.mean(steps < position_step, axis=1) >= MIN_RESTING
    if not is_resting.any():
        return NO_REST
    # First time and end of each run; the first time of the block does not rest.
    edges = np.flatnonzero(np.diff(is_resting.astype(np.int8), prepend=0, append=0)) + 1
    runs = tuple(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    rests = Rests(runs, _rest_bits(frames.n_verts, targets, finer))
    with_rests, _ = quantized_basis(targets, rate_weight, BasisCoding(rests))
    plain, _ = quantized_basis(targets, rate_weight)

    bits, bits_without = _bits_of_times(with_rests), _bits_of_times(plain)
    costs = [(bits[start:end].sum(), bits_without[start:end].sum()) for start, end in runs]
    budget, kept_runs = MAX_COST_SHARE * bits_without.sum(), []
    by_extra_bits = sorted(zip(costs, runs, strict=True), key=lambda row: row[0][0] - row[0][1])
    for (cost, cost_without), run in by_extra_bits:
        if cost > MAX_COST_RATIO * cost_without:
            if cost - cost_without > budget:
                continue
            budget -= cost - cost_without
        kept_runs.append(run)
    return Rests(tuple(sorted(kept_runs)), rests.bits) if kept_runs else NO_REST


def _rest_bits(n_verts: int, targets: Floats, finer: float) -> int:
    """Return the precision, in bits, with which rounding moves a vertex by one step RMS per frame.

    An integer of a basis vector moves V vertices by finer sqrt(T / V) steps, RMS. A frame has K C
    of them with independent errors of 1 / sqrt(12) each, and so has the frame before.
    """
    n_modes, n_columns, n_frames = targets.shape
    motion = finer * math.sqrt(n_frames / n_verts * n_modes * n_columns / 6.0)
    max_scale = LARGEST_INTEGER / (2.0 * max(1.0, float(np.abs(targets).max())))
    bits = min(round(math.log2(motion)), math.floor(math.log2(max_scale)))
    return int(np.clip(bits, 0, MAX_REST_BITS))


def _bits_of_times(integers: npt.NDArray[np.int32]) -> Floats:
    """Return the estimated bits of the nonzero integers, of shape (K, C, T), of each time."""
    return np.asarray(2.0 * np.log2(1.0 + np.abs(integers.astype(np.float64))).sum(axis=(0, 1)))
