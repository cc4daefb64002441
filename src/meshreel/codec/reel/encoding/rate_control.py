"""Searches for the quantization step of a target, independent of meshes and streams."""

from collections.abc import Callable

import numpy as np

MAX_TRIALS = 16
MAX_JUMP = np.log(64.0)
MAX_SPAN = np.log(1e7)
"""Largest logarithmic ratios of consecutive steps, and of any step and the first."""


def meet_limit(
    measure: Callable[[float], float],
    limit: float,
    start: float,
    *,
    rises: bool,
    tolerance: float = 0.01,
) -> float | None:
    """Return the step whose measure is closest to a limit from below; None if all exceed it.

    Measures are nearly powers of the step, so the search interpolates logarithms linearly (regula
    falsi, with bisection if it stalls) until the measure is within the tolerance of the limit.

    Parameters
    ----------
    measure : callable
        Non-negative measure of a step; called once per step.
    limit : float
        Above 0.
    start : float
        First step to try.
    rises : bool
        Whether the measure grows with the step (an error) or falls (a size).
    tolerance : float, default 0.01
        Share of the limit that the measure may fall short by.
    """
    direction = 1.0 if rises else -1.0
    below: tuple[float, float] | None = None
    above: tuple[float, float] | None = None
    place = 0.0
    for trial in range(MAX_TRIALS):
        measured = measure(float(start * np.exp(direction * place)))
        excess = float(np.log(max(measured, 1e-300) / limit))
        if excess <= 0.0:
            below = max(below or (place, excess), (place, excess))
            if excess >= np.log1p(-tolerance):
                break
        else:
            above = min(above or (place, excess), (place, excess))
        before, place = (
            place,
            float(np.clip(_next_place(below, above, trial), -MAX_SPAN, MAX_SPAN)),
        )
        if place == before:
            break
    return None if below is None else float(start * np.exp(direction * below[0]))


def _next_place(
    below: tuple[float, float] | None, above: tuple[float, float] | None, trial: int
) -> float:
    """Next place to try, from place and excess of the best trials on both sides of the limit."""
    if below is None or above is None:
        place, excess = below or above or (0.0, 0.0)
        # As if the measure were proportional to the step; farther with every trial.
        jump = (1.0 + 0.3 * trial) * abs(excess) + 0.02 * 1.5**trial
        return float(place + np.sign(-excess) * min(jump, MAX_JUMP))
    (low, short), (high, excess) = below, above
    if trial % 3 == 2:
        return 0.5 * (low + high)
    # Slightly below the crossing, because the measure must not exceed the limit.
    aim = short + 0.98 * (0.0 - short)
    return low + (high - low) * (aim - short) / (excess - short)


def least_cost(
    cost: Callable[[float], float], start: float, *, n_trials: int = 6, ratio: float = 1.5
) -> float:
    """Return a step of low cost, found by descent with decreasing ratios of steps.

    Parameters
    ----------
    cost : callable
        Cost of a step; called once per step.
    start : float
    n_trials : int, default 6
        Maximum number of steps to try.
    ratio : float, default 1.5
        Ratio of the first two steps; above 1.
    """
    best, least = start, cost(start)
    tried = {start}
    for _ in range(n_trials - 1):
        step = best / ratio
        if step in tried:
            step = best * ratio
        if step in tried:
            ratio = float(np.sqrt(ratio))
            step = best / ratio
        tried.add(step)
        step_cost = cost(step)
        if step_cost < least:
            best, least = step, step_cost
    return best
