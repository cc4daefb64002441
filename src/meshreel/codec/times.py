"""The sections START and TIMES: when frames are shown."""

import struct
from collections.abc import Iterator

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.bitstream.container import write_number, write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.model.timing import Timing

TIMING_SECTIONS = {Section.START, Section.TIMES}

_TIME = struct.Struct("<d")

MAX_RESIDUAL = 2**61
"""Larger residuals may not fit a variable-length integer; the time itself is stored instead."""


def timing_sections(timing: Timing) -> Iterator[tuple[Section, bytes]]:
    """Yield the section of the start or the times; none for a rate from 0 s."""
    if timing.times is not None and len(timing.times) > 1:
        yield Section.TIMES, write_times(timing.times)
    elif timing.start_s:
        yield Section.START, write_number(timing.start_s)


def write_times(times_s: Floats) -> bytes:
    """Encode finite, ascending times in seconds, of shape (T,), without loss.

    Each is predicted linearly from the two before it. Its residual is the number of doubles between
    the prediction and the time, which is small if times are evenly spaced up to rounding.
    """
    with np.errstate(over="ignore"):
        expected = times_s[1:-1] + (times_s[1:-1] - times_s[:-2])
    ranks = _ranks(times_s[2:]), _ranks(expected)
    residuals = [None, None, *(a - b for a, b in zip(*map(np.ndarray.tolist, ranks), strict=True))]
    payload = bytearray()
    for time, residual in zip(times_s.tolist(), residuals, strict=False):
        if residual is None or abs(residual) >= MAX_RESIDUAL:
            payload += b"\0" + _TIME.pack(time)
        else:
            payload += write_varint(1 + (2 * residual if residual >= 0 else -2 * residual - 1))
    return bytes(payload)


def _ranks(numbers: Floats) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the position of each double in the ascending list of all doubles, relative to 0."""
    bits = np.ascontiguousarray(numbers, np.float64).view(np.int64)
    return np.where(bits < 0, np.iinfo(np.int64).min - bits, bits)
