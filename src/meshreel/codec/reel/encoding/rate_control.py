"""Searches for the quantization step of a target, independent of meshes and streams."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")

SAMPLED_BLOCKS = 3
"""Blocks of a long sequence that are coded to compare steps: a key block and others."""

MAX_TRIALS = 16
TOLERANCE = 0.01
"""Share of a limit by which the measure of the returned step may be below it."""

CLOSE_STEPS = 0.04
STRIDE_GROWTH = 1.5
"""A search for the least cost ends when the logarithm of the next step is this close to the best
one; a stride that lowers the cost is followed by one that is this many times as long."""

MAX_JUMP = np.log(64.0)
MAX_SPAN = np.log(1e7)
"""Largest logarithmic ratios of consecutive steps, and of any step and the first."""


def meet_limit(
    measure: Callable[[float], float], limit: float, start: float, *, rises: bool
) -> float | None:
    """Return the step whose measure is closest to a limit from below; None if all exceed it.

    Measures are nearly powers of the step, so the search interpolates logarithms linearly (regula
    falsi, with bisection if it stalls) until the measure is close to the limit.

    Parameters
    ----------
    measure : callable
        Non-negative measure of a step; called once per step.
    limit : float
        The limit; above 0.
    start : float
        First step to try.
    rises : bool
        Whether the measure grows with the step (an error) or falls (a size).
    """
    direction = 1.0 if rises else -1.0
    below: tuple[float, float] | None = None
    above: tuple[float, float] | None = None
    offset = 0.0  # logarithm of the step relative to the start, in the direction of the measure
    for trial in range(MAX_TRIALS):
        measured = measure(float(start * np.exp(direction * offset)))
        excess = float(np.log(max(measured, 1e-300) / limit))
        if excess <= 0.0:
            below = max(below or (offset, excess), (offset, excess))
            if excess >= np.log1p(-TOLERANCE):
                break
        else:
            above = min(above or (offset, excess), (offset, excess))
        previous = offset
        offset = float(np.clip(_next_offset(below, above, trial), -MAX_SPAN, MAX_SPAN))
        if offset == previous:
            break
    return None if below is None else float(start * np.exp(direction * below[0]))


def _next_offset(
    below: tuple[float, float] | None, above: tuple[float, float] | None, trial: int
) -> float:
    """Return the next offset to try, from the best trials on both sides of the limit."""
    if below is None or above is None:
        offset, excess = below or above or (0.0, 0.0)
        # Jump as if the measure were proportional to the step, and farther with every trial.
        jump = (1.0 + 0.3 * trial) * abs(excess) + 0.02 * 1.5**trial
        return float(offset + np.sign(-excess) * min(jump, MAX_JUMP))
    (low, deficit), (high, excess) = below, above
    if trial % 3 == 2:
        return 0.5 * (low + high)
    # Slightly below the crossing, because the measure must not exceed the limit.
    goal = deficit + 0.98 * (0.0 - deficit)
    return low + (high - low) * (goal - deficit) / (excess - deficit)


def least_cost(
    cost: Callable[[float], float], start: float, *, n_trials: int = 6, ratio: float = 1.5
) -> float:
    """Return a step of low cost: bracket the minimum in growing strides, then fit parabolas.

    Parameters
    ----------
    cost : callable
        Cost of a step, which may be infinite; called once per step.
    n_trials : int, default 6
        Maximum number of steps to try. Strides that lower the cost do not count: more are tried
        where the best step is far from the start, as for few frames.
    ratio : float, default 1.5
        Ratio of the first two steps; above 1.
    """
    stride = float(np.log(ratio))
    costs = {0.0: cost(start)}  # by logarithm of the step, relative to the start
    n_left = n_trials - 1
    while n_left > 0 and len(costs) < MAX_TRIALS:
        best = min(costs, key=lambda offset: costs[offset])
        finer = max((offset for offset in costs if offset < best), default=None)
        coarser = min((offset for offset in costs if offset > best), default=None)
        if finer is not None and coarser is not None:
            offset = _lowest_offset(*((i, costs[i]) for i in (finer, best, coarser)))
            if abs(offset - best) < CLOSE_STEPS:
                break
        else:
            offset = best - stride if finer is None else best + stride
        costs[offset] = cost(float(start * np.exp(offset)))
        if costs[offset] < costs[best] and (finer is None or coarser is None):
            stride *= STRIDE_GROWTH
        else:
            n_left -= 1
    return float(start * np.exp(min(costs, key=lambda offset: costs[offset])))


def _lowest_offset(
    finer: tuple[float, float], best: tuple[float, float], coarser: tuple[float, float]
) -> float:
    """Return the offset of the minimum of the parabola through three offsets and costs.

    Without a parabola, return the middle of the wider gap, or of the one without an infinite cost.
    """
    left, right = best[0] - finer[0], coarser[0] - best[0]
    down, up = finer[1] - best[1], coarser[1] - best[1]
    curvature = left * up + right * down
    if 0.0 < curvature < np.inf:
        return best[0] + 0.5 * (right**2 * down - left**2 * up) / curvature
    goes_right = right > left if np.isfinite(up) == np.isfinite(down) else np.isfinite(up)
    return best[0] + 0.5 * (right if goes_right else -left)


def sampled(blocks: Sequence[T]) -> Sequence[T]:
    """Return the blocks for comparing steps: consecutive ones in the middle, or all if few.

    Blocks far apart would share fewer fields than those of the sequence.
    """
    if len(blocks) <= 2 * SAMPLED_BLOCKS:
        return blocks
    first = (len(blocks) - SAMPLED_BLOCKS) // 2
    return blocks[first : first + SAMPLED_BLOCKS]


def estimated_bytes(sizes: Sequence[int], n_blocks: int) -> float:
    """Estimate the bytes of all blocks from those of `sampled` ones."""
    key, *others = sizes
    return key + sum(others) * (n_blocks - 1) / max(1, len(others))
