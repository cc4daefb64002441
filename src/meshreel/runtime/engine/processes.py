"""Worker processes of this machine, which are replaced when they die.

Each process serves one thread of the parent over its own pipe, so the call that killed it is known
and other calls continue. A pool of the standard library breaks completely, and pebble's if a
process dies while idle or during a reply: see docs/engine.md.
"""

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.runtime.threads import limit_cores, n_cores, one_blas_thread

Result = TypeVar("Result")

MAX_DEATHS = 2
"""Processes that may die during one call before it is abandoned."""

EXIT_TIMEOUT_S = 10.0
"""Seconds that a process has to exit after its connection is closed."""

BLAS_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

_SPAWN = multiprocessing.get_context("spawn")  # threads and BLAS do not survive a fork


class ProcessWorkers:
    """`n_workers` processes, started on demand.

    They share the cores equally, at least one each, and use one BLAS thread each.
    """

    def __init__(self, n_workers: int) -> None:
        if n_workers < 1:
            raise InvalidInputError(f"workers must be 1 or more; got {n_workers}")
        self._n_workers = n_workers
        self._cores_per_process = max(1, n_cores() // n_workers)
        self._lock = threading.Lock()
        self._processes: set[_ServingProcess] = set()
        self._stopped = False
        self._local = threading.local()
        self._threads = ThreadPoolExecutor(n_workers, "meshreel-worker", initializer=_block_ctrl_c)

    @property
    def n_workers(self) -> int:
        """Number of processes."""
        return self._n_workers

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """Submit a call to one of the processes, and return its future."""
        return self._threads.submit(self._call, function, args)

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """Submit a call again; a process that died, or ran out of memory, has been replaced."""
        return self.submit(function, *args)

    def close(self, *, at_once: bool) -> None:
        """End the processes after submitted calls are complete; `at_once`, kill them."""
        if at_once:
            with self._lock:
                self._stopped = True
                for process in self._processes:
                    process.kill()
        self._threads.shutdown(cancel_futures=at_once)
        for process in self._processes:
            process.end()

    def _call(self, function: Callable[..., Result], args: tuple[Any, ...]) -> Result:
        """Return the call's result from the process of this thread."""
        for _ in range(MAX_DEATHS):
            process = self._process()
            try:
                result: Result = process.call(function, args)
            except _ProcessDiedError:
                exit_reason = process.end()
            except MemoryError:
                process.end()  # the next call starts in a new process, with all memory free
                raise
            else:
                return result
        raise WorkerDiedError(
            f"{MAX_DEATHS} worker processes died during this call, the last with {exit_reason}; if "
            "memory is short, use fewer workers or a smaller block_frames"
        )

    def _process(self) -> "_ServingProcess":
        """The process of this thread, started if necessary."""
        process: _ServingProcess | None = getattr(self._local, "process", None)
        if process is not None and process.is_alive():
            return process
        with self._lock:
            if self._stopped:
                raise WorkerDiedError("the workers were stopped")
            if process is not None:
                self._processes.discard(process)
                process.end()
            self._local.process = process = _ServingProcess(self._cores_per_process)
            self._processes.add(process)
        return process


class _ProcessDiedError(Exception):
    """A process that ended during a call."""


class _ServingProcess:
    """A process that executes calls sequentially."""

    def __init__(self, n_cores: int) -> None:
        self._connection, other_end = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(other_end, n_cores), daemon=True)
        self._process.start()
        other_end.close()  # so that reading fails when the process dies

    def is_alive(self) -> bool:
        return self._process.is_alive()

    def call(self, function: Callable[..., Any], args: tuple[Any, ...]) -> Any:
        request = pickle.dumps((function, args))
        try:
            self._connection.send_bytes(request)
            reply = self._connection.recv_bytes()
        except (EOFError, OSError):
            raise _ProcessDiedError from None
        succeeded, result = pickle.loads(reply)
        if succeeded:
            return result
        raise result

    def kill(self) -> None:
        self._process.kill()

    def end(self) -> str:
        """End the process, and return its signal or exit code."""
        self._connection.close()
        self._process.join(EXIT_TIMEOUT_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(EXIT_TIMEOUT_S)
        code = self._process.exitcode or 0
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _serve(connection: Connection, n_cores: int) -> None:
    """Answer requests until the parent closes the connection or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C, and ends this process
    threading.Thread(target=_end_with_parent, name="meshreel-parent", daemon=True).start()
    limit_cores(n_cores)
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))  # for a BLAS that is loaded later
    while True:
        try:
            request = connection.recv_bytes()
        except (EOFError, OSError):
            return
        reply = _reply(request)
        try:
            connection.send_bytes(reply)
        except OSError:
            return


def _end_with_parent() -> None:
    """End this process, even during a call, when the parent is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _reply(request: bytes) -> bytes:
    """Execute a call; return whether it succeeded, and its result or exception, pickled."""
    try:
        function, args = pickle.loads(request)
        with one_blas_thread():
            return pickle.dumps((True, function(*args)))
    except BaseException as error:
        error.add_note(f"in a worker process:\n{traceback.format_exc()}")
        return pickle.dumps((False, _portable(error)))


def _portable(error: BaseException) -> BaseException:
    """Return the error, or a RuntimeError with its text if it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _block_ctrl_c() -> None:
    """Block SIGINT in this thread, and so in a process it starts until that process ignores it."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
