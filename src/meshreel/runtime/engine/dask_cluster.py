"""Workers of a Dask cluster; needs the extra [dask].

Dask moves the calls of a dead worker to another, up to ``allowed-failures`` times. That count
includes calls that were only queued on the worker: they are retried here, one at a time, when no
other call is unfinished.

Calls wait for a cluster without workers up to a limit: see `engine.worker_watch`.
"""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.runtime.engine.worker_watch import WorkerCount, WorkerWatch
from meshreel.runtime.threads import limit_cores, n_cores, one_blas_thread

Result = TypeVar("Result")

CONNECT_TIMEOUT_S = 10.0
"""Seconds to wait for the connection to a scheduler."""

ANSWER_TIMEOUT_S = 10.0
"""Seconds to wait for its number of workers."""

MAX_WAIT_S = 3600.0
"""Default number of seconds that calls wait for a cluster without workers."""

_WORKER = "meshreel_worker"
"""Attribute of a MemoryError: the address of the worker."""

CLOSE_TIMEOUT_S = 30.0
"""Seconds that closing waits for a result that is being received."""


@dataclass(eq=False)
class _Call:
    """A call, its future, and its task on the cluster.

    `is_suspect` if workers died that had it, perhaps because of another call. `excluded_worker` is
    the address of a worker that must not run it if there are others.
    """

    function: Callable[..., Any]
    args: tuple[Any, ...]
    future: "Future[Any]" = field(default_factory=Future)
    task: Any = None
    is_suspect: bool = False
    excluded_worker: str | None = None
    _is_done: bool = False
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def succeed(self, result: Any) -> None:
        """Set the result of the future unless it was cancelled."""
        if self._claim():
            self.future.set_result(result)

    def fail(self, error: BaseException) -> None:
        """Set the error of the future unless it was cancelled."""
        if self._claim():
            self.future.set_exception(error)

    def on_done(self, future: "Future[Any]") -> None:
        """Cancel the task if the future was cancelled."""
        if future.cancelled():
            self.cancel_task()

    def cancel_task(self) -> None:
        """Cancel the task without waiting for the scheduler, which may not answer."""
        if self.task is not None:
            client = self.task.client
            client.loop.add_callback(client.cancel, [self.task], asynchronous=True)

    def _claim(self) -> bool:
        """Return True for the first caller, unless the future was cancelled."""
        with self._lock:
            is_first, self._is_done = not self._is_done, True
        return is_first and self.future.set_running_or_notify_cancel()


class DaskWorkers:
    """The workers of a Dask cluster.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as ``tcp://10.0.0.5:8786``.
    max_wait_s : float, default 3600
        Seconds that calls wait while the cluster has no workers. Then they fail, as do further
        calls until the cluster has workers again.

    Raises
    ------
    InvalidInputError
        If Dask is not installed, no scheduler answers, or `max_wait_s` is not finite and above 0.
    """

    def __init__(self, address: str, max_wait_s: float = MAX_WAIT_S) -> None:
        if not 0 < max_wait_s < float("inf"):
            raise InvalidInputError(f"max_wait_s must be finite and above 0; got {max_wait_s}")
        client = _client_class()
        self._lock = threading.Lock()
        self._unfinished: set[_Call] = set()
        self._suspects: deque[_Call] = deque()
        self._result_lock = threading.Lock()  # held while a result is received from the cluster
        self._is_closed = False
        try:
            self._client = client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InvalidInputError(
                f"no Dask scheduler answers at {address!r} ({error}); use the address that it "
                "prints, such as tcp://10.0.0.5:8786"
            ) from None
        self._watch = WorkerWatch(
            address, self._count, lambda: len(self._unfinished), self._abandon, max_wait_s
        )
        self._watch.start()

    @property
    def n_workers(self) -> int:
        """Number of threads of running workers; 0 if the scheduler does not answer."""
        return self._count().n_threads

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """Submit a call to the cluster, and return its future."""
        return self._submit_call(_Call(function, args))

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """Submit a failed call again, not to a worker that ran out of memory.

        If workers died during the call, it starts as a suspect.
        """
        is_suspect = isinstance(error, WorkerDiedError)
        excluded_worker = getattr(error, _WORKER, None)
        return self._submit_call(
            _Call(function, args, is_suspect=is_suspect, excluded_worker=excluded_worker)
        )

    def _submit_call(self, call: _Call) -> "Future[Any]":
        refusal = self._watch.refusal()
        if refusal is not None:
            call.fail(WorkerDiedError(refusal))
            return call.future
        call.future.add_done_callback(call.on_done)  # also keeps a reference, which Dask needs
        self._start(call)
        return call.future

    def close(self, *, at_once: bool) -> None:
        """Disconnect from the cluster; results of running calls are dropped."""
        self._is_closed = True
        self._watch.close()
        # If a client closes while a result is being received, the result never arrives, and the
        # thread that waits for it, shared by all clients of a process, hangs.
        is_locked = self._result_lock.acquire(timeout=CLOSE_TIMEOUT_S)
        try:
            self._client.close()
        finally:
            if is_locked:
                self._result_lock.release()

    def _start(self, call: _Call) -> None:
        with self._lock:
            self._unfinished.add(call)
        if call.future.cancelled():
            self._finish(call)
            return
        try:
            workers = self._other_workers(call.excluded_worker)
            call.task = self._client.submit(
                _run_on_worker, call.function, call.args,
                pure=False, workers=workers, allow_other_workers=bool(workers),
            )  # fmt: skip
            call.task.add_done_callback(partial(self._finish_task, call))
        except Exception as error:
            call.fail(error)
            self._finish(call)

    def _other_workers(self, excluded_worker: str | None) -> list[str] | None:
        """Addresses of all workers but one; None, which means any, if there are no others."""
        if excluded_worker is None:
            return None
        running = self._client.sync(self._client.scheduler.ncores_running)
        return [address for address in running if address != excluded_worker] or None

    def _finish_task(self, call: _Call, task: Any) -> None:
        """Settle the call with its task's result, or set it aside as a suspect to be retried."""
        from distributed import KilledWorker

        try:
            call.succeed(self._result(task))
        except KilledWorker as error:
            if call.is_suspect:
                call.fail(
                    WorkerDiedError(
                        f"{error.allowed_failures + 1} Dask workers died during this call; see "
                        "their logs; if memory is short, use fewer threads per worker or a smaller "
                        "block_frames"
                    )
                )
            else:
                call.is_suspect = True
                with self._lock:
                    self._suspects.append(call)
        except CancelledError:
            call.fail(WorkerDiedError("the Dask scheduler lost the call; check that it is running"))
        except BaseException as error:
            call.fail(error)
        self._finish(call)

    def _result(self, task: Any) -> Any:
        with self._result_lock:
            if self._is_closed:
                raise CancelledError
            return task.result()

    def _finish(self, call: _Call) -> None:
        """Remove a finished call; if it was the last, start a suspect, which then runs alone."""
        with self._lock:
            self._unfinished.discard(call)
            alone = not self._unfinished and self._suspects
            suspect = self._suspects.popleft() if alone else None
        if suspect is not None:
            self._start(suspect)

    def _count(self) -> WorkerCount:
        scheduler, sync = self._client.scheduler, self._client.sync
        try:
            running = sync(scheduler.ncores_running, callback_timeout=ANSWER_TIMEOUT_S)
            if running:
                return WorkerCount(sum(running.values()))
            paused = sync(scheduler.ncores, callback_timeout=ANSWER_TIMEOUT_S)
            return WorkerCount(0, n_paused=len(paused))
        except (OSError, RuntimeError):  # network error, timeout, or closed client
            return WorkerCount(0, is_reachable=False)

    def _abandon(self, reason: str) -> None:
        """Fail all unfinished calls, including suspects."""
        with self._lock:
            calls = [*self._unfinished, *self._suspects]
            self._unfinished.clear()
            self._suspects.clear()
        for call in calls:
            call.fail(WorkerDiedError(reason))
            call.cancel_task()


def _client_class() -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise InvalidInputError(
            "a scheduler needs Dask, which is not installed; pip install 'meshreel[dask]'"
        ) from None
    return Client


def _run_on_worker(function: Callable[..., Result], args: tuple[Any, ...]) -> Result:
    """Execute a call on as many cores as its worker has threads."""
    from distributed import get_worker

    n_threads = get_worker().state.nthreads
    if n_threads < n_cores():
        limit_cores(n_threads)
    with one_blas_thread():
        try:
            return function(*args)
        except MemoryError as error:
            setattr(error, _WORKER, get_worker().address)
            raise
