"""Waits with a time limit and a descriptive error."""

import signal
import time
from contextlib import contextmanager

TEST_S = 150.0
"""Time limit of tests that wait for other processes, also on a busy machine."""


@contextmanager
def time_limit(seconds, what):
    """Raise an error in the main thread when the block exceeds the time limit."""

    def stop(number, frame):
        raise AssertionError(f"waited {seconds:g} s for {what}; it hangs where this was raised")

    began, handler = time.monotonic(), signal.signal(signal.SIGALRM, stop)
    outer_s, _ = signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        rest_s = max(0.001, outer_s - (time.monotonic() - began)) if outer_s else 0
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, rest_s)


def wait_until(condition, what, seconds=60.0):
    """Return once the condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"waited {seconds:g} s for {what}"
        time.sleep(0.05)
