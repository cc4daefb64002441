"""Child processes forked from a process that has encoded or decoded, or is doing so.

Every wait has a limit; a hanging child is killed.
"""

import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cached_property, partial

import numpy as np
import pytest
from threadpoolctl import threadpool_info

import meshreel
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.reel_file import ReelFile
from meshreel.kernel.host import SourceReader
from meshreel.runtime.threads import fork_safe_lock, one_blas_thread
from samples.costs import draws
from samples.meshes import waving_grid

LIMIT_S = 60.0

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="the platform has no fork"),
    pytest.mark.filterwarnings(
        "ignore:This process .* is multi-threaded, use of fork:DeprecationWarning"
    ),
]

SEQUENCE = waving_grid(24)
DATA = meshreel.encode(SEQUENCE, block_frames=4)
FRAMES = meshreel.decode(DATA).vertices


def end_of(pid, what):
    """Return the exit status of a child; fail, and kill it, if it does not end."""
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    raise AssertionError(f"waited {LIMIT_S:g} s for {what}; it was killed")


def forked(work):
    """Fork a child that does the work, and return its process id; it exits with 0 on success."""
    pid = os.fork()
    if pid:
        return pid
    signal.alarm(int(2 * LIMIT_S))  # ends the child if the test fails early
    status = 1
    try:
        work()
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(status)


def assert_succeeds_in_child(work):
    assert end_of(forked(work), "a forked child") == 0


def assert_codes():
    assert meshreel.encode(SEQUENCE, block_frames=4) == DATA
    assert np.array_equal(meshreel.decode(DATA).vertices, FRAMES)


encode = partial(meshreel.encode, block_frames=4)
WORK = {"encode": (encode, SEQUENCE), "decode": (meshreel.decode, DATA)}


@contextmanager
def held_elsewhere(context):
    """Keep another thread inside the context."""
    entered, leave = threading.Event(), threading.Event()

    def hold():
        with context:
            entered.set()
            assert leave.wait(2 * LIMIT_S)

    with ThreadPoolExecutor(1) as holder:
        holding = holder.submit(hold)
        try:
            assert entered.wait(LIMIT_S)
            yield
        finally:
            leave.set()
        holding.result(LIMIT_S)


@pytest.mark.parametrize("in_parent", WORK)
@pytest.mark.parametrize(
    "start",
    [
        "fork",
        pytest.param("forkserver", marks=pytest.mark.slow),
        pytest.param("spawn", marks=pytest.mark.slow),
    ],
)
def test_pool_encodes_and_decodes_after_the_parent_did(start, in_parent):
    function, argument = WORK[in_parent]
    function(argument)
    with multiprocessing.get_context(start).Pool(2) as pool:
        streams = pool.map_async(encode, [SEQUENCE] * 3, chunksize=1)
        sequences = pool.map_async(meshreel.decode, [DATA] * 3, chunksize=1)
        assert streams.get(LIMIT_S) == [DATA] * 3
        for sequence in sequences.get(LIMIT_S):
            assert np.array_equal(sequence.vertices, FRAMES)


@pytest.mark.slow
def test_grandchild_codes_after_both_parents_used_threads():
    def code_and_fork():
        assert_codes()
        assert_succeeds_in_child(assert_codes)

    assert_succeeds_in_child(code_and_fork)


@pytest.mark.slow
def test_children_code_while_another_thread_of_the_parent_encodes():
    stop = threading.Event()

    def encode_on():
        while not stop.is_set():
            encode(SEQUENCE)

    with ThreadPoolExecutor(1) as encoder:
        encoding = encoder.submit(encode_on)
        try:
            for _ in range(max(4, draws(8))):
                assert_succeeds_in_child(assert_codes)
        finally:
            stop.set()
        encoding.result(LIMIT_S)
    assert_codes()


def blas_threads():
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_child_lifts_the_blas_limit_of_another_thread():
    outside = blas_threads()

    def limit():
        with one_blas_thread():
            assert blas_threads() == {1}
        assert blas_threads() == outside

    with held_elsewhere(one_blas_thread()):
        assert_succeeds_in_child(limit)
    assert blas_threads() == outside


def test_child_forked_within_the_blas_limit_can_leave_it():
    def leave(context):
        context.__exit__(None, None, None)
        assert_codes()

    context = one_blas_thread()
    with context:
        pid = forked(lambda: leave(context))
        assert end_of(pid, "a child forked within the limit") == 0


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "grid.reel"
    path.write_bytes(DATA)
    return path


@pytest.mark.slow
def test_children_read_all_frames_of_an_inherited_file(path):
    with meshreel.open(path) as reel:

        def read(first):
            for number in range(100):
                frame = (first + 5 * number) % len(FRAMES)
                assert np.array_equal(reel[frame].vertices, FRAMES[frame])

        assert np.array_equal(reel[3].vertices, FRAMES[3])
        children = [forked(lambda first=6 * child: read(first)) for child in range(4)]
        for number, frame in enumerate(reel):
            assert np.array_equal(frame.vertices, FRAMES[number])
        assert [end_of(child, "a reader") for child in children] == [0, 0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "lock_of",
    [
        lambda reel: reel._opened.file._reader._lock,
        lambda reel: reel._opened.file._lock,
        lambda reel: reel._frames._lock,
    ],
    ids=["reading", "the mesh", "frames"],
)
def test_child_reads_an_inherited_file_while_another_thread_reads_it(path, lock_of):
    with meshreel.open(path) as reel, held_elsewhere(lock_of(reel)):
        assert_succeeds_in_child(lambda: np.testing.assert_array_equal(reel[:].vertices, FRAMES))


def test_child_continues_an_iteration_of_its_parent(path):
    with meshreel.open(path) as reel:
        frames = (frame.vertices for frame in reel)
        next(frames)
        assert_succeeds_in_child(
            lambda: np.testing.assert_array_equal(np.stack(list(frames)), FRAMES[1:])
        )
        assert np.array_equal(np.stack(list(frames)), FRAMES[1:])


def test_position_is_unchanged_when_a_child_reads_the_same_file(path):
    with path.open("rb") as file:
        reader = SourceReader(file)
        assert file.read(5) == DATA[:5]
        assert_succeeds_in_child(lambda: reader.bytes_at(100, 50))
        assert file.read() == DATA[5:]


def test_file_of_the_caller_stays_open_when_its_reader_is_deleted(path):
    with path.open("rb") as file:
        reel = ReelFile(file)
        del reel
        assert not file.closed


def test_lock_of_another_thread_is_free_in_a_child():
    lock = fork_safe_lock()

    def acquire():
        with lock, lock:
            pass

    with held_elsewhere(lock):
        assert_succeeds_in_child(acquire)


def test_lock_of_the_forking_thread_is_still_held_in_a_child():
    lock = fork_safe_lock()

    def release():
        lock.__exit__(None, None, None)
        with ThreadPoolExecutor(1) as other:
            other.submit(lambda: lock.__enter__()).result(LIMIT_S)

    with lock:
        pid = forked(release)
    assert end_of(pid, "a child that holds the lock") == 0


def test_cached_property_is_computed_in_a_child_while_another_thread_computes_it():
    attributes = [var for var in vars(FieldMesh).values() if isinstance(var, cached_property)]
    own_lock = getattr(attributes[0], "lock", None)
    if own_lock is None:
        pytest.skip("cached properties of this Python have no lock")
    with held_elsewhere(own_lock):
        assert_succeeds_in_child(assert_codes)
