"""Rates of two codecs compared at equal error (BD-rate), and rates at given errors.

References
----------
G. Bjontegaard, "Calculation of average PSNR differences between RD-curves", VCEG-M33, 2001; with
piecewise cubic (PCHIP) interpolation in place of one cubic, as in JCTVC-B055.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from meshreel.evaluation.envelopes import Point, lower_envelope


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


def _log_curve(points: Sequence[Point]) -> tuple[np.ndarray, np.ndarray]:
    """Log errors, ascending, and log rates of the lower envelope."""
    envelope = np.log(np.array(lower_envelope(points)).reshape(-1, 2))[::-1]
    return envelope[:, 1], envelope[:, 0]
