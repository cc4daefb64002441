"""Calls for workers, which import them from here."""

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
    """The square; the first call for a number kills its process."""
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
    blas = [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]
    return n_cores(), blas


def ignores_ctrl_c(seconds):
    """Told to stop by ctrl-C, it goes on; gives its process."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(seconds)
    return os.getpid()


def encode_or_die(source, options, version):
    """As `encode_input`; an input kills its worker if its name says so."""
    from meshreel.app.batch.encode_input import encode_input

    path = Path(source)
    if path.stem == "deadly":
        die_always()
    if path.stem == "dies_once":
        die_once(0, path.parent)
    return encode_input(source, options, version)
