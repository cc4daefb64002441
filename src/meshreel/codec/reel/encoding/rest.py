"""Times of a block at which the model rests, in whole or in part: an encoder's choice.

Rounding errors of the temporal basis change from frame to frame: a model that rests would seem to
crawl. So frames at which it rests are predicted from the one before, with finer steps where these
are needed. docs/codec.md, "Rest".
"""

import math

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER, BlockFrames
from meshreel.codec.reel.normative.timeline import NO_REST, Rests
from meshreel.kernel.frames import MAX_REST_BITS, encode_times

Floats = npt.NDArray[np.float64]
Runs = tuple[tuple[int, int], ...]

LEAST_RESTING = 0.5
"""Share of the vertices that have to rest, of those that do not rest in all of the block."""

LEAST_STILL = 0.02
"""Share of the vertices that have to rest in all of a block for its means to be modes."""

MAX_COST_RATIO, MAX_COST_SHARE = 2.0, 0.01
"""A run is kept if its bits are at most this many times those of the same times without it; or as
long as all such runs together cost at most this share of the bits of the basis more."""


def has_still_part(frames: BlockFrames, step: float) -> bool:
    """Whether some vertices, not all, rest in all of a block; `step` is that of its fields.

    Basis vectors of the means, which are constant, then keep them where they are.
    """
    _, ranges = frames.sampled_motion
    share = float(np.mean(ranges < step / math.sqrt(frames.n_frames)))
    return LEAST_STILL <= share < 1.0


def find_rests(
    frames: BlockFrames, wanted: Floats, step: float, finer: float, price: float
) -> Rests:
    """The resting times of a block, and the precision of their integers.

    A vertex rests where it moves by less than a quantization step. A time rests if most vertices
    do, unless this takes many more bits, as where the others move a lot.

    Parameters
    ----------
    frames : BlockFrames
    wanted : float64 array of shape (K, C, T)
        Its basis vectors, in steps.
    step : float
        Of the fields, in diagonals.
    finer : float
        Step of the temporal basis by that of the fields, both as they act on positions.
    price : float
        Squared steps that a bit is worth.
    """
    position_step = step / math.sqrt(frames.n_frames)
    steps, ranges = frames.sampled_motion
    steps = steps[:, ranges >= position_step]
    if not steps.size:
        return NO_REST
    share = np.mean(steps < position_step, axis=1)
    runs = _runs_of(np.concatenate([[False], share >= LEAST_RESTING]))
    if not runs:
        return NO_REST
    found = Rests(runs, _rest_bits(frames.n_verts, wanted, finer))
    with_rests = encode_times(wanted, price, found.flags(frames.n_frames), found.bits)
    without = encode_times(wanted, price)
    kept = _affordable(runs, _bits_of_times(with_rests), _bits_of_times(without))
    return Rests(kept, found.bits) if kept else NO_REST


def _affordable(runs: Runs, bits: Floats, bits_without: Floats) -> Runs:
    """The runs that are kept; see `MAX_COST_RATIO`."""
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
    """First time and end of each run; the first time of all does not rest."""
    edges = np.flatnonzero(np.diff(is_resting.astype(np.int8), append=0)) + 1
    return tuple(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _rest_bits(n_verts: int, wanted: Floats, finer: float) -> int:
    """The precision with which rounding moves a vertex by a quantization step, RMS, in a frame.

    An integer of a basis vector moves V vertices by finer sqrt(T / V) steps, RMS. There are K C of
    them in a frame, with independent errors of 1 / sqrt(12) each, in the frame before too.
    """
    n_modes, n_columns, n_frames = wanted.shape
    moved = finer * math.sqrt(n_frames / n_verts * n_modes * n_columns / 6.0)
    most = LARGEST_INTEGER / (2.0 * max(1.0, float(np.abs(wanted).max())))
    bits = min(round(math.log2(moved)), math.floor(math.log2(most)))
    return int(np.clip(bits, 0, MAX_REST_BITS))


def _bits_of_times(integers: npt.NDArray[np.int32]) -> Floats:
    """Estimated bits of integers of shape (K, C, T), without those of zeros, for each time."""
    return np.asarray(2.0 * np.log2(1.0 + np.abs(integers.astype(np.float64))).sum(axis=(0, 1)))
