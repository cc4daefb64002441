"""Rate-distortion curves: lower envelopes and their comparison at equal error or rate.

References
----------
G. Bjontegaard, "Calculation of average PSNR differences between RD-curves", VCEG-M33, 2001; with
piecewise cubic (PCHIP) interpolation instead of one cubic, as in JCTVC-B055.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.runtime.extras import PEERS

Point = tuple[float, float]  # rate, error


@dataclass(frozen=True)
class RateDifference:
    """Rate of a codec relative to another at equal error."""

    percent: float | None
    """-50 is half the rate; None if they are not comparable."""
    low_error: float = 0.0
    high_error: float = 0.0
    """The common range of errors; 0 if they are not comparable."""
    reason: str = ""
    """Why they are not comparable, or empty."""


def lower_envelope(points: Sequence[Point]) -> list[Point]:
    """The Pareto-optimal points, by ascending rate."""
    envelope: list[Point] = []
    for rate, error in sorted(points):
        if rate > 0 and error > 0 and (not envelope or error < envelope[-1][1]):
            envelope.append((rate, error))
    return envelope


def bd_rate(codec: Sequence[Point], other: Sequence[Point]) -> RateDifference:
    """Bjontegaard's rate difference of a codec relative to another.

    The mean difference of log rate over log error between the lower envelopes in their common
    range; nothing is extrapolated.

    Parameters
    ----------
    codec, other : sequences of (rate, error)
        Points with an error of 0 are ignored.
    """
    curves = [_log_curve(points) for points in (codec, other)]
    if any(len(errors) < 2 for errors, _ in curves):
        return RateDifference(None, reason="fewer than 2 points")
    low = max(errors[0] for errors, _ in curves)
    high = min(errors[-1] for errors, _ in curves)
    if not low < high:
        return RateDifference(None, reason="no common errors")
    rate, rate_other = (
        _interpolator(errors, rates).integrate(low, high) for errors, rates in curves
    )
    percent = 100 * np.expm1(float(rate - rate_other) / (high - low))
    return RateDifference(float(percent), float(np.exp(low)), float(np.exp(high)))


def rate_at_error(points: Sequence[Point], error: float) -> float | None:
    """The rate of the lower envelope at this error; None beyond its ends."""
    errors, rates = _log_curve(points)
    log_error = np.log(error)
    if len(errors) < 2 or not errors[0] <= log_error <= errors[-1]:
        return None
    return float(np.exp(_interpolator(errors, rates)(log_error)))


def error_at_equal_rate(codec: Sequence[Point], other: Sequence[Point]) -> RateDifference:
    """As `bd_rate`, with rates and errors exchanged: the error of a codec relative to another.

    `low_error` and `high_error` are the common range of rates.
    """
    first, second = ([(error, rate) for rate, error in points] for points in (codec, other))
    return bd_rate(first, second)


def _interpolator(x: np.ndarray, y: np.ndarray) -> Any:
    """Piecewise cubic (PCHIP) interpolation of y over ascending x."""
    return PEERS.load("interpolate").PchipInterpolator(x, y)


def _log_curve(points: Sequence[Point]) -> tuple[np.ndarray, np.ndarray]:
    """Log errors, ascending, and log rates of the lower envelope."""
    envelope = np.log(np.array(lower_envelope(points)).reshape(-1, 2))[::-1]
    return envelope[:, 1], envelope[:, 0]
