"""Rate-distortion curves: lower envelopes, and two of them compared at equal error or rate.

References
----------
G. Bjontegaard, "Calculation of average PSNR differences between RD-curves", VCEG-M33, 2001; with
piecewise cubic (PCHIP) interpolation in place of one cubic, as in JCTVC-B055.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

Point = tuple[float, float]  # rate, error


@dataclass(frozen=True)
class RateDifference:
    """Rate of one codec against that of another at equal error.

    Attributes
    ----------
    percent : float or None
        -50 is half the rate; None where the two cannot be compared.
    low_error, high_error : float
        The errors that both have; 0 where they cannot be compared.
    reason : str
        Why they cannot be compared; empty where they can.
    """

    percent: float | None
    low_error: float = 0.0
    high_error: float = 0.0
    reason: str = ""


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


def bd_rate(codec: Sequence[Point], other: Sequence[Point]) -> RateDifference:
    """Bjontegaard's rate difference of a codec against another.

    The mean difference of log rate over log error, where the lower envelopes of both have
    points at either side; nothing is extrapolated.

    Parameters
    ----------
    codec, other : sequences of (rate, error)
        Points with an error of 0 are left out, as are those that another point beats.
    """
    curves = [_log_curve(points) for points in (codec, other)]
    if any(len(errors) < 2 for errors, _ in curves):
        return RateDifference(None, reason="fewer than 2 points")
    low = max(errors[0] for errors, _ in curves)
    high = min(errors[-1] for errors, _ in curves)
    if not low < high:
        return RateDifference(None, reason="no common errors")
    rate, rate_other = (
        PchipInterpolator(errors, rates).integrate(low, high) for errors, rates in curves
    )
    percent = 100 * np.expm1(float(rate - rate_other) / (high - low))
    return RateDifference(float(percent), float(np.exp(low)), float(np.exp(high)))


def rate_at_error(points: Sequence[Point], error: float) -> float | None:
    """The rate at which the lower envelope has this error; None beyond its ends."""
    errors, rates = _log_curve(points)
    wanted = np.log(error)
    if len(errors) < 2 or not errors[0] <= wanted <= errors[-1]:
        return None
    return float(np.exp(PchipInterpolator(errors, rates)(wanted)))


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


def _log_curve(points: Sequence[Point]) -> tuple[np.ndarray, np.ndarray]:
    """Log errors, ascending, and log rates of the lower envelope."""
    envelope = np.log(np.array(lower_envelope(points)).reshape(-1, 2))[::-1]
    return envelope[:, 1], envelope[:, 0]
