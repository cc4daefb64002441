"""Seconds of work: short work is repeated, and the median counts."""

import statistics
import time
from collections.abc import Callable
from typing import Any, TypeVar

REPEAT_BELOW_S = 2.0
REPEATS = 3
Value = TypeVar("Value")


def timed(work: Callable[[], Value], n_repeats: int) -> tuple[Value, list[float]]:
    """The value of the work, and the seconds of each run; long work is run once."""
    seconds: list[float] = []
    while True:
        start = time.perf_counter()
        value = work()
        seconds.append(time.perf_counter() - start)
        if len(seconds) >= n_repeats or seconds[0] >= REPEAT_BELOW_S:
            return value, seconds


def seconds_of(encode_s: list[float], decode_s: list[float]) -> dict[str, Any]:
    """Medians of the seconds of encoding and decoding, and those of each run."""
    return {
        "encode": statistics.median(encode_s),
        "decode": statistics.median(decode_s),
        "encode_runs": encode_s,
        "decode_runs": decode_s,
    }
