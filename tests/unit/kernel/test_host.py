"""Memory, threads and bytes that the binding lends to the core."""

import ctypes
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from io import BytesIO

import numpy as np
import pytest

from meshreel.codec.encoder import encode
from meshreel.errors import TruncatedStreamError
from meshreel.kernel import files
from meshreel.kernel.files import OpenFile, run_tasks
from meshreel.kernel.host import ALLOCATOR, TASK, HostMemory
from meshreel.kernel.library import library
from meshreel.runtime.threads import POOL
from samples.meshes import waving_grid


class Memory:
    """The memory of a file, with the functions that the core calls."""

    def __init__(self):
        self.memory = HostMemory(*ALLOCATOR)

    def allocate(self, size):
        function = library().reel_host_allocate
        function.restype = ctypes.c_void_p
        return function(ctypes.byref(self.memory), ctypes.c_size_t(size))

    def release(self, address, size):
        function = library().reel_host_release
        function.restype = None
        function(ctypes.byref(self.memory), ctypes.c_void_p(address), ctypes.c_size_t(size))


def exchange_blocks(memory, seed, n_steps):
    """Allocate and release blocks in random order; those that are held must keep their bytes."""
    rng, held = np.random.default_rng(seed), {}
    for _ in range(n_steps):
        if held and rng.integers(2):
            address = list(held)[rng.integers(len(held))]
            size, value = held.pop(address)
            assert ctypes.string_at(address, size) == bytes([value]) * size
            memory.release(address, size)
        else:
            size, value = int(2 ** rng.uniform(0, 20)), int(rng.integers(256))
            address = memory.allocate(size)
            assert address % 64 == 0
            assert address not in held
            ctypes.memset(address, value, size)
            held[address] = size, value
    return sum(size for size, _ in held.values())


def test_blocks_are_aligned_and_do_not_overlap():
    memory = Memory()
    held = 0
    for seed in range(3):
        held += exchange_blocks(memory, seed, 1000)
        assert memory.memory.n_bytes == held


def test_threads_share_the_memory_of_a_file():
    memory = Memory()
    with ThreadPoolExecutor(4) as threads:
        held = list(threads.map(exchange_blocks, [memory] * 4, range(4), [500] * 4))
    assert memory.memory.n_bytes == sum(held)


@pytest.mark.parametrize("size", [2**60, 2**64 - 1])
def test_memory_that_the_system_lacks_is_no_address(size):
    memory = Memory()
    assert memory.allocate(size) is None
    assert memory.memory.n_bytes == 0


@pytest.fixture
def use_cores(monkeypatch):
    """Return a function that replaces the pool by one of some threads, and returns it."""
    with ExitStack() as pools:

        def use(n_cores):
            pool = pools.enter_context(ThreadPoolExecutor(n_cores, POOL))
            monkeypatch.setattr(files, "pool", lambda: pool)
            return pool

        yield use


def run(function, n_tasks, n_threads=2):
    task = TASK(function)
    run_tasks(n_threads, None, ctypes.cast(task, ctypes.c_void_p).value, None, n_tasks)


@pytest.mark.parametrize("n_cores", [1, 4])
@pytest.mark.parametrize("n_tasks", [1, 2, 3, 100])
def test_every_task_runs_once(use_cores, n_cores, n_tasks):
    use_cores(n_cores)
    calls = []
    run(lambda shared, number: calls.append(number), n_tasks, n_cores)
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


class StoredFile(BytesIO):
    """A file that accepts announcements of the bytes to read."""

    def fetch(self, start, stop):
        pass


@pytest.fixture(scope="module")
def stream():
    return encode(waving_grid(40, 12, 14), block_frames=8)


def failing(error):
    def fail(*_arguments):
        raise error

    return fail


@pytest.mark.parametrize("method", ["read", "fetch"])
def test_opening_raises_the_exception_of_the_file_when_it_cannot_be_read(stream, method):
    file, error = StoredFile(stream), OSError("the disk is gone")
    setattr(file, method, failing(error))
    with pytest.raises(OSError, match="the disk is gone") as raised:
        OpenFile(file, 1e9)
    assert raised.value is error


def test_mesh_is_decoded_when_the_file_can_be_read_again(stream, monkeypatch):
    file = StoredFile(stream)
    opened = OpenFile(file, 1e9)
    with monkeypatch.context() as patch:
        patch.setattr(file, "read", failing(OSError("the disk is gone")))
        for _ in range(2):
            with pytest.raises(OSError, match="the disk is gone"):
                opened.read_mesh()
    np.testing.assert_array_equal(opened.faces, OpenFile(stream, 1e9).faces)


def test_reading_is_refused_when_the_file_has_become_shorter(stream):
    file = StoredFile(stream)
    opened = OpenFile(file, 1e9)
    file.truncate(50)
    with pytest.raises(TruncatedStreamError, match="ended before byte 99; it was longer"):
        opened.read_mesh()
