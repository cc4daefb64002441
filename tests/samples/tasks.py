"""Functions that workers execute."""

import os
import signal
import time
from pathlib import Path

from threadpoolctl import threadpool_info

from meshreel.runtime.threads import n_cores


def square(number):
    return number * number


def slow_square(number, seconds):
    time.sleep(seconds)
    return number * number


def process_id():
    time.sleep(0.05)
    return os.getpid()


def fail(message):
    raise ValueError(message)


class UnpicklableError(Exception):
    def __init__(self, first, second):
        super().__init__(f"{first} and {second}")


def fail_unpicklably():
    raise UnpicklableError("one", "two")


def die_once(number, folder):
    """Return the square; the first call for a number kills its process."""
    mark = Path(folder) / f"died-{number}"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die_once_if(number, folder, deadly):
    return die_once(number, folder) if number in deadly else square(number)


def die_always():
    os.kill(os.getpid(), signal.SIGKILL)


def die_or_square(number, deadly):
    if number == deadly:
        time.sleep(0.1)
        die_always()
    time.sleep(0.02)
    return square(number)


def die_within_a_long_reply():
    return DyingReply()


class DyingReply:
    """Dies while it is pickled."""

    def __reduce__(self):
        die_always()


def cores_and_blas_threads():
    import numpy as np

    np.ones((2, 2)) @ np.ones((2, 2))
    blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return n_cores(), blas


def ignores_ctrl_c(seconds):
    """Ignore ctrl-C and return the process id."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(seconds)
    return os.getpid()


def encode_or_die(source, options, version):
    """Like `encode_input`, but inputs named "deadly" or "dies_once" kill the worker."""
    from meshreel.app.batch.encode_input import encode_input

    path = Path(source)
    if path.stem == "deadly":
        die_always()
    if path.stem == "dies_once":
        die_once(0, path.parent)
    return encode_input(source, options, version)
