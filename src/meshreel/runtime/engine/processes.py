"""Processes of this machine that do calls, and are replaced when they die.

Each process serves one thread of this one over a pipe of its own, so that it is known which call a
process died of: the others go on. A pool of the standard library breaks as a whole, and
pebble's where a process dies idle or in the middle of a reply: see docs/engine.md.
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
"""Processes that one call may take with it before it is given up."""

END_S = 10.0
"""Seconds that a process has to end by itself, once its connection is closed."""

BLAS_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OMP_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)

_SPAWN = multiprocessing.get_context("spawn")  # threads and BLAS do not survive a fork


class ProcessWorkers:
    """So many processes, started when they are first needed.

    They share the cores: each computes in its part of them, at least one, and with one BLAS thread.

    Parameters
    ----------
    n_workers : int
        1 or more.
    """

    def __init__(self, n_workers: int) -> None:
        if n_workers < 1:
            raise InvalidInputError(f"workers must be 1 or more; got {n_workers}")
        self._n_workers = n_workers
        self._cores_each = max(1, n_cores() // n_workers)
        self._lock = threading.Lock()
        self._processes: set[_ServingProcess] = set()
        self._stopped = False
        self._own = threading.local()
        self._threads = ThreadPoolExecutor(
            n_workers, "meshreel-worker", initializer=_leave_ctrl_c_to_the_main_thread
        )

    @property
    def n_workers(self) -> int:
        """Number of processes."""
        return self._n_workers

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """The outcome to come of one call in one of the processes."""
        return self._threads.submit(self._call, function, args)

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """As `submit`: a process that died, or ran out of memory, has been replaced."""
        return self.submit(function, *args)

    def close(self, *, at_once: bool) -> None:
        """End the processes, after the calls handed out or, `at_once`, in the middle of them."""
        if at_once:
            with self._lock:
                self._stopped = True
                for process in self._processes:
                    process.kill()
        self._threads.shutdown(cancel_futures=at_once)
        for process in self._processes:
            process.end()

    def _call(self, function: Callable[..., Result], args: tuple[Any, ...]) -> Result:
        """The call's result, from the process of this thread."""
        for _ in range(MAX_DEATHS):
            process = self._process()
            try:
                result: Result = process.call(function, args)
            except _ProcessDiedError:
                ending = process.end()
            except MemoryError:
                process.end()  # so that the next call begins with all memory that there is
                raise
            else:
                return result
        raise WorkerDiedError(
            f"{MAX_DEATHS} worker processes died of it, the last with {ending}; where memory is "
            "short, fewer workers or a smaller block_frames need less"
        )

    def _process(self) -> "_ServingProcess":
        """The living process of this thread."""
        process: _ServingProcess | None = getattr(self._own, "process", None)
        if process is not None and process.is_alive():
            return process
        with self._lock:
            if self._stopped:
                raise WorkerDiedError("the workers were stopped")
            if process is not None:
                self._processes.discard(process)
                process.end()
            self._own.process = process = _ServingProcess(self._cores_each)
            self._processes.add(process)
        return process


class _ProcessDiedError(Exception):
    """The process ended during a call."""


class _ServingProcess:
    """A process that does one call after another."""

    def __init__(self, n_cores: int) -> None:
        self._connection, other_end = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(other_end, n_cores), daemon=True)
        self._process.start()
        other_end.close()  # so that the death of the process ends what is read here

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
        """Signal or exit code of the process, which ends as its connection closes or is killed."""
        self._connection.close()
        self._process.join(END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(END_S)
        code = self._process.exitcode or 0
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _serve(connection: Connection, n_cores: int) -> None:
    """Answer requests until the connection is closed, by the parent or by its death."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl-C is the parent's, which ends this one
    threading.Thread(target=_end_with_parent, name="meshreel-parent", daemon=True).start()
    limit_cores(n_cores)
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))  # for a BLAS that calls load
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
    """End this process, in the middle of a call, when the parent was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _reply(request: bytes) -> bytes:
    """Pickled: whether the call succeeded, and its result or its exception."""
    try:
        function, args = pickle.loads(request)
        with one_blas_thread():
            return pickle.dumps((True, function(*args)))
    except BaseException as error:
        error.add_note(f"in a worker process:\n{traceback.format_exc()}")
        return pickle.dumps((False, _portable(error)))


def _portable(error: BaseException) -> BaseException:
    """The error, or one of its text where it does not survive pickling."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _leave_ctrl_c_to_the_main_thread() -> None:
    """Block SIGINT in this thread: a process it starts inherits that, before it can ignore it."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
