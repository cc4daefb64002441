"""Threads that the binding lends to the core."""

import ctypes
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import pytest

from meshreel.kernel import host
from meshreel.kernel.host import TASK, run_tasks
from meshreel.runtime.threads import POOL


@pytest.fixture
def use_cores(monkeypatch):
    """Return a function that replaces the cores and the pool, and returns the new pool."""
    with ExitStack() as pools:

        def use(n_cores):
            pool = pools.enter_context(ThreadPoolExecutor(n_cores, POOL))
            monkeypatch.setattr(host, "n_cores", lambda: n_cores)
            monkeypatch.setattr(host, "pool", lambda: pool)
            return pool

        yield use


def run(function, n_tasks):
    task = TASK(function)
    run_tasks(None, ctypes.cast(task, ctypes.c_void_p).value, None, n_tasks)


@pytest.mark.parametrize("n_cores", [1, 4])
@pytest.mark.parametrize("n_tasks", [1, 2, 3, 100])
def test_every_task_runs_once(use_cores, n_cores, n_tasks):
    use_cores(n_cores)
    calls = []
    run(lambda shared, number: calls.append(number), n_tasks)
    assert Counter(calls) == Counter(range(n_tasks))


def test_tasks_run_in_several_threads(use_cores):
    use_cores(2)
    meeting = threading.Barrier(2, timeout=60)  # breaks if one thread runs both tasks
    run(lambda shared, number: meeting.wait(), 2)
    assert not meeting.broken


def test_tasks_of_threads_of_the_pool_do_not_wait_for_the_pool(use_cores):
    pool, calls = use_cores(2), []
    futures = [pool.submit(run, lambda shared, number: calls.append(number), 5) for _ in range(8)]
    for future in futures:
        future.result(timeout=60)
    assert Counter(calls) == Counter(list(range(5)) * 8)


def test_caller_runs_all_tasks_if_the_pool_is_busy(use_cores):
    pool, done, calls = use_cores(2), threading.Event(), []
    busy = [pool.submit(done.wait, 60) for _ in range(2)]
    run(lambda shared, number: calls.append(threading.current_thread()), 5)
    done.set()
    assert calls == [threading.current_thread()] * 5
    assert all(future.result() for future in busy)
