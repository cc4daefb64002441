"""Waits with a limit, which say what was waited for."""

import signal
import time
from contextlib import contextmanager

TEST_S = 150.0
"""Seconds in which every test that waits for other processes ends, on a busy machine too."""


@contextmanager
def time_limit(seconds, what):
    """Whatever the main thread does within it fails where it is when the time is over."""

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
