"""Memory and threads that the binding lends to the core."""

import ctypes
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack

import numpy as np
import pytest

from meshreel.kernel import host
from meshreel.kernel.host import TASK, HostMemory, run_tasks
from meshreel.runtime.threads import POOL


@pytest.fixture(autouse=True)
def no_unused_blocks(monkeypatch):
    """Begin without released blocks."""
    monkeypatch.setattr(host, "_unused", {})


def test_blocks_are_aligned_and_do_not_overlap():
    memory, rng, held = HostMemory(), np.random.default_rng(0), {}
    for _ in range(2000):
        if held and rng.integers(2):
            address = list(held)[rng.integers(len(held))]
            size, value = held.pop(address)
            assert ctypes.string_at(address, size) == bytes([value]) * size
            memory.release(None, address, size)
        else:
            size, value = int(2 ** rng.uniform(0, 20)), int(rng.integers(256))
            address = memory.allocate(None, size)
            assert address % 64 == 0
            ctypes.memset(address, value, size)
            held[address] = size, value
        assert memory.n_bytes == sum(size for size, _ in held.values())


@pytest.mark.parametrize("size", [0, 1, 1000, 10**6, 10**7])
def test_released_blocks_are_reused_by_other_files(size):
    one, other = HostMemory(), HostMemory()
    address = one.allocate(None, size)
    one.release(None, address, size)
    assert other.allocate(None, size) == address
    assert host.unused_bytes() == 0


def test_unused_blocks_are_bounded(monkeypatch):
    monkeypatch.setattr(host, "MAX_UNUSED_BYTES", 10**6)
    memory = HostMemory()
    addresses = [(memory.allocate(None, size), size) for size in range(1000, 200_000, 7000)]
    for address, size in addresses:
        memory.release(None, address, size)
    assert 800_000 < host.unused_bytes() <= 10**6


def test_memory_that_the_system_lacks_is_no_address():
    memory = HostMemory()
    assert memory.allocate(None, 2**60) is None
    assert memory.n_bytes == 0


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
