"""Progress as lines, for output that is no terminal: a pipe, a log file, a job of a cluster."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from meshreel.app.cli.lines import escaped
from meshreel.app.cli.progress_words import PaceClock, clock_text
from meshreel.runtime.progress import Progress

FIRST_AFTER_S = 5.0
EVERY_S = 10.0
"""Seconds until the first line, and between lines."""


@contextmanager
def progress_lines(
    stream: TextIO | None = None, *, first_after_s: float = FIRST_AFTER_S, every_s: float = EVERY_S
) -> Iterator[Progress]:
    """A progress callback that writes a plain line every few seconds, also between calls.

    Such as "meshreel: encoding, try 3: 12 of 175 frames, 8.4 frames/s, 0:19 left (0:42 so far)".

    Parameters
    ----------
    stream : text file, optional
        Default: stderr.
    first_after_s, every_s : float
        Time until the first line, and between the others.
    """
    began_s, clock = time.monotonic(), PaceClock()
    latest: list[tuple[str, float]] = [("working", 0.0)]
    is_over = threading.Event()

    def report(stage: str, fraction: float) -> None:
        clock.words(fraction)  # the pace is measured from here
        latest[0] = stage, fraction

    def write() -> None:
        wait_s = first_after_s
        while not is_over.wait(wait_s):
            elapsed = clock_text(time.monotonic() - began_s)
            with suppress(OSError, ValueError):  # the stream may be closed
                line = f"meshreel: {escaped(_state(*latest[0], clock))} ({elapsed} so far)"
                print(line, file=stream or sys.stderr, flush=True)
            wait_s = every_s

    writer = threading.Thread(target=write, name="meshreel-progress", daemon=True)
    writer.start()
    try:
        yield report
    finally:
        is_over.set()
        writer.join()


def _state(stage: str, fraction: float, clock: PaceClock) -> str:
    """The stage, and its progress if that is known."""
    words = clock.words(fraction)
    if not words and 0 < fraction < 1:
        words = f"{100 * fraction:.0f} %"
    return f"{stage}: {words}" if words else stage
