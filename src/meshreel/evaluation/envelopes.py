"""Lower envelopes of rate-distortion points, and methods compared on their overlap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

Floats = npt.NDArray[np.float64]
Point = tuple[float, float]  # rate, error


@dataclass(frozen=True)
class Overlap:
    """Two envelopes over the rates that both cover.

    Attributes
    ----------
    low_bpvf, high_bpvf : float
        The rates that both have.
    error_ratio : float
        Error of the first by that of the second at equal rate, geometric mean over log rate.
    """

    low_bpvf: float
    high_bpvf: float
    error_ratio: float


def lower_envelope(points: Sequence[Point]) -> list[Point]:
    """The points that no other beats in both rate and error, by ascending rate."""
    kept: list[Point] = []
    for rate, error in sorted(points):
        if rate > 0 and error > 0 and (not kept or error < kept[-1][1]):
            kept.append((rate, error))
    return kept


def compare_at_equal_rate(first: Sequence[Point], second: Sequence[Point]) -> Overlap | None:
    """How the errors of two envelopes compare where their rates overlap; None if they do not.

    Piecewise cubic (PCHIP) interpolation of log error over log rate, as for Bjontegaard's
    figures; nothing is extrapolated.
    """
    curves = [np.log(np.array(lower_envelope(points))) for points in (first, second)]
    if any(len(curve) < 2 for curve in curves):
        return None
    low = max(curve[0, 0] for curve in curves)
    high = min(curve[-1, 0] for curve in curves)
    if not low < high:
        return None
    rates = np.linspace(low, high, 101)
    error, error_other = (PchipInterpolator(*curve.T)(rates) for curve in curves)
    difference = float(np.mean(error - error_other))
    return Overlap(float(np.exp(low)), float(np.exp(high)), float(np.exp(difference)))
