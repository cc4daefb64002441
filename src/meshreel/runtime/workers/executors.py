"""The executor that options choose: worker processes of this machine, or a Dask cluster.

A pool of the standard library breaks when one of its processes dies. Each process therefore has
its own pool, which serves one thread of the parent: the call that killed it is known, and other
calls continue.
"""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, TypeVar

from meshreel.errors import InvalidInputError, Keyword, WorkerDiedError
from meshreel.runtime.progress import Progress
from meshreel.runtime.threads import limit_cores, n_cores, one_blas_thread
from meshreel.runtime.workers.cluster import cluster_executor

Result = TypeVar("Result")

POLL_S = 0.5

MAX_DEATHS = 2
"""Number of processes that die before or during a call until it is abandoned."""

BLAS_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

_SPAWN = multiprocessing.get_context("spawn")  # threads and BLAS do not survive a fork


@contextmanager
def executor_of(
    workers: int | None, scheduler: str | None, progress: Progress
) -> Iterator[tuple[Executor | None, int]]:
    """Context manager for an executor and the number of its workers; None for this process."""
    if scheduler is not None:
        with cluster_executor(scheduler) as (executor, n_workers):
            if not n_workers:
                progress(f"waiting for workers; 'dask worker {scheduler}' starts one", 0.0)
            yield executor, n_workers
    elif workers is not None:
        with ProcessExecutor(workers) as executor:
            yield executor, workers
    else:
        yield None, 1


def completed(futures: Iterable[Future[Result]]) -> set[Future[Result]]:
    """Wait until a future is done, or for half a second; return all that are done."""
    # With a timeout, because Windows delivers Ctrl-C only between waits.
    return wait(futures, POLL_S, FIRST_COMPLETED).done


class ProcessExecutor(Executor):
    """An executor of `n_workers` processes, started on demand.

    They share the cores equally, at least one each, and use one BLAS thread each. A call whose
    process dies is called again; its future raises `WorkerDiedError` if that process dies too. As a
    context manager, it kills running calls on an exception (including Ctrl-C).

    Raises
    ------
    InvalidInputError
        If `n_workers` is below 1.
    """

    def __init__(self, n_workers: int) -> None:
        if n_workers < 1:
            raise InvalidInputError(f"workers must be 1 or more; got {n_workers}")
        self._cores_per_process = max(1, n_cores() // n_workers)
        self._lock = threading.Lock()
        self._workers: set[_Worker] = set()
        self._stopped = False
        self._local = threading.local()
        self._threads = ThreadPoolExecutor(n_workers, "meshreel-worker", initializer=_block_ctrl_c)

    def submit(self, fn: Callable[..., Result], /, *args: Any, **kwargs: Any) -> "Future[Result]":
        """Submit a call to one of the processes, and return its future.

        Function, arguments and result are pickled.
        """
        return self._threads.submit(self._call, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after the submitted calls; without `wait`, kill them now."""
        if not wait:
            with self._lock:
                self._stopped = True
                for worker in self._workers:
                    worker.kill()
        self._threads.shutdown(cancel_futures=cancel_futures or not wait)
        for worker in self._workers:
            worker.end()

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        self.shutdown(wait=kind is None)

    def _call(self, call: Callable[[], Result]) -> Result:
        """Return the call's result from the process of this thread."""
        for _ in range(MAX_DEATHS):
            try:
                return self._worker().call(call)
            except BrokenProcessPool:
                self._forget_worker()
            except MemoryError:
                self._forget_worker()  # the next call has all memory of a new process
                raise
        raise WorkerDiedError(
            f"{MAX_DEATHS} worker processes died during this call; if memory is short, use fewer "
            "workers or a smaller ",
            Keyword("block_frames"),
        )

    def _worker(self) -> "_Worker":
        """The process of this thread, started if necessary."""
        worker: _Worker | None = getattr(self._local, "worker", None)
        if worker is None:
            with self._lock:
                if self._stopped:
                    raise WorkerDiedError("the workers were stopped")
                self._local.worker = worker = _Worker(self._cores_per_process)
                self._workers.add(worker)
        return worker

    def _forget_worker(self) -> None:
        worker, self._local.worker = self._local.worker, None
        with self._lock:
            self._workers.discard(worker)
        worker.end()


class _Worker:
    """A process that executes calls sequentially."""

    def __init__(self, n_cores: int) -> None:
        self._pool = ProcessPoolExecutor(1, _SPAWN, initializer=_prepare, initargs=(n_cores,))
        self._process = self._pool.submit(os.getpid)

    def call(self, call: Callable[[], Result]) -> Result:
        return self._pool.submit(_run, call).result()

    def kill(self) -> None:
        with suppress(OSError, BrokenProcessPool):  # it has died already
            os.kill(self._process.result(), getattr(signal, "SIGKILL", signal.SIGTERM))

    def end(self) -> None:
        """End the process between calls, even if it does not react."""
        self.kill()
        self._pool.shutdown()


def _prepare(n_cores: int) -> None:
    """Prepare a process for its calls."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C, and ends this process
    threading.Thread(target=_end_with_parent, name="meshreel-parent", daemon=True).start()
    limit_cores(n_cores)
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))  # for a BLAS that is loaded later


def _end_with_parent() -> None:
    """End this process, even during a call, when the parent is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(call: Callable[[], Result]) -> Result:
    """Return the result of a call; raise a RuntimeError for an error that cannot be pickled."""
    try:
        with one_blas_thread():
            return call()
    except BaseException as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise RuntimeError(f"{type(error).__name__}: {error}") from None
        raise


def _block_ctrl_c() -> None:
    """Block SIGINT in this thread, and so in a process it starts until that process ignores it."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
