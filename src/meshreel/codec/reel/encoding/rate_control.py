"""Searches for the quantisation step of a target; they know neither meshes nor streams."""

from collections.abc import Callable

import numpy as np

MAX_TRIALS = 16
LARGEST_LEAP = np.log(64.0)
FARTHEST = np.log(1e7)
"""How far from the start the search goes, as a ratio of steps."""


def meet_limit(
    measure: Callable[[float], float],
    limit: float,
    start: float,
    *,
    rises: bool,
    tolerance: float = 0.01,
) -> float | None:
    """The step whose measure comes nearest to a limit from below; None if none stays below it.

    Measures are nearly powers of the step, so that the search goes along straight lines between
    logarithms (regula falsi, with bisection where it stalls), and ends when the measure is within
    the tolerance of the limit.

    Parameters
    ----------
    measure : callable
        Measure of a step, not negative; called once for a step, with larger and smaller ones.
    limit : float
        Above 0.
    start : float
        First step to try.
    rises : bool
        Whether the measure grows with the step (an error) or falls (a size).
    tolerance : float, default 0.01
        Share of the limit that may be left over.
    """
    direction = 1.0 if rises else -1.0
    below: tuple[float, float] | None = None
    above: tuple[float, float] | None = None
    place = 0.0
    for trial in range(MAX_TRIALS):
        found = measure(float(start * np.exp(direction * place)))
        excess = float(np.log(max(found, 1e-300) / limit))
        if excess <= 0.0:
            below = max(below or (place, excess), (place, excess))
            if excess >= np.log1p(-tolerance):
                break
        else:
            above = min(above or (place, excess), (place, excess))
        before, place = place, float(np.clip(_next_place(below, above, trial), -FARTHEST, FARTHEST))
        if place == before:
            break
    return None if below is None else float(start * np.exp(direction * below[0]))


def _next_place(
    below: tuple[float, float] | None, above: tuple[float, float] | None, trial: int
) -> float:
    """Where to look next, for the places and excesses of the best on either side."""
    if below is None or above is None:
        place, excess = below or above or (0.0, 0.0)
        # As if the measure were the step itself, and a little more with every trial.
        leap = (1.0 + 0.3 * trial) * abs(excess) + 0.02 * 1.5**trial
        return float(place + np.sign(-excess) * min(leap, LARGEST_LEAP))
    (low, short), (high, excess) = below, above
    if trial % 3 == 2:
        return 0.5 * (low + high)
    # A little below where the line crosses the limit: measures below it are wanted.
    aim = short + 0.98 * (0.0 - short)
    return low + (high - low) * (aim - short) / (excess - short)


def least_cost(
    cost: Callable[[float], float], start: float, *, n_trials: int = 6, ratio: float = 1.5
) -> float:
    """A step of low cost, by descent over ratios of steps that grow finer.

    Parameters
    ----------
    cost : callable
        Of a step; called once for each.
    start : float
    n_trials : int, default 6
        How often the cost is asked for.
    ratio : float, default 1.5
        Of the first two steps that are tried; above 1.
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
        found = cost(step)
        if found < least:
            best, least = step, found
    return best
