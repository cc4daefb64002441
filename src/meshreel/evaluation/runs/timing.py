"""Timing: short work is repeated, and the median is reported."""

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

REPEAT_BELOW_S = 2.0
REPEATS = 3
Value = TypeVar("Value")


def timed(work: Callable[[], Value], n_repeats: int) -> tuple[Value, list[float]]:
    """Return the value of the work, and the wall-clock seconds of each run.

    Long work is run once.
    """
    value, wall_s, _ = timed_on_both_clocks(work, n_repeats)
    return value, wall_s


def timed_on_both_clocks(
    work: Callable[[], Value], n_repeats: int
) -> tuple[Value, list[float], list[float]]:
    """Return the value of the work, and wall-clock and processor seconds of each run.

    Processor seconds include all threads of this process. Long work is run once.
    """
    wall_s: list[float] = []
    processor_s: list[float] = []
    while True:
        start, start_processor = time.perf_counter(), time.process_time()
        value = work()
        wall_s.append(time.perf_counter() - start)
        processor_s.append(time.process_time() - start_processor)
        if len(wall_s) >= n_repeats or wall_s[0] >= REPEAT_BELOW_S:
            return value, wall_s, processor_s


def seconds_of(encode_s: list[float], decode_s: list[float]) -> dict[str, Any]:
    """Seconds of encoding and decoding: medians and all runs."""
    return {
        "encode": statistics.median(encode_s),
        "decode": statistics.median(decode_s),
        "encode_runs": encode_s,
        "decode_runs": decode_s,
    }


def processor_seconds_of(
    encode_s: Sequence[list[float]], decode_s: Sequence[list[float]]
) -> dict[str, Any]:
    """As `seconds_of`, with medians of processor seconds.

    Parameters
    ----------
    encode_s, decode_s : two lists each
        Wall-clock and processor seconds of each run.
    """
    return {
        **seconds_of(encode_s[0], decode_s[0]),
        "encode_processor": statistics.median(encode_s[1]),
        "decode_processor": statistics.median(decode_s[1]),
    }
