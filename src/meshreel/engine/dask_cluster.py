"""Workers of a Dask cluster that do calls; the extra [dask] brings them.

Dask itself gives the calls of a worker that died to another, as often as its scheduler's
``allowed-failures`` says. It suspects all calls that the worker had, those that waited too: here
they get another chance, one after the other, when no other call is under way.

A cluster without workers is waited for: it may be about to grow.
"""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from typing import Any, TypeVar

from meshreel.engine.cluster_call import ClusterCall
from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.threads import limit_cores, n_cores, one_blas_thread

Result = TypeVar("Result")

CONNECT_S = 10.0
"""Seconds in which a scheduler has to answer."""

CLOSE_S = 30.0
"""Seconds that closing waits for a result that is just coming in."""


class DaskWorkers:
    """The workers of the cluster that a scheduler has.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://10.0.0.5:8786``.

    Raises
    ------
    InvalidInputError
        If Dask is not installed, or no scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        client = _client_class()
        self._lock = threading.Lock()
        self._n_under_way = 0
        self._suspects: deque[ClusterCall] = deque()
        self._taking = threading.Lock()  # held while a result is taken over from the cluster
        self._is_closed = False
        try:
            self._client = client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InvalidInputError(
                f"no Dask scheduler answers at {address!r} ({error}); give its address as it "
                "prints it, such as tcp://10.0.0.5:8786"
            ) from None

    @property
    def n_workers(self) -> int:
        """Threads of all workers that the cluster has now."""
        return sum(self._client.nthreads().values())

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """The outcome to come of one call on the cluster."""
        call = ClusterCall(function, args)
        call.outcome.add_done_callback(call.cancel)  # this also keeps Dask from forgetting it
        self._begin(call)
        return call.outcome

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster; calls that still run there end without an effect."""
        self._is_closed = True
        # A client that closes under a result that is being taken never gives it; and all clients
        # of a process share the one thread that waits for it.
        is_quiet = self._taking.acquire(timeout=CLOSE_S)
        try:
            self._client.close()
        finally:
            if is_quiet:
                self._taking.release()

    def _begin(self, call: ClusterCall) -> None:
        with self._lock:
            self._n_under_way += 1
        if call.outcome.cancelled():
            self._leave()
            return
        try:
            call.task = self._client.submit(_in_share, call.function, call.args, pure=False)
            call.task.add_done_callback(partial(self._end, call))
        except Exception as error:
            call.fail(error)
            self._leave()

    def _end(self, call: ClusterCall, task: Any) -> None:
        """Pass on what a task came to; a suspect is set aside, to be called again alone."""
        from distributed import KilledWorker

        try:
            call.succeed(self._result(task))
        except KilledWorker as error:
            if call.is_suspect:
                call.fail(WorkerDiedError(_deaths(error.allowed_failures + 1)))
            else:
                call.is_suspect = True
                with self._lock:
                    self._suspects.append(call)
        except CancelledError:
            call.fail(WorkerDiedError("the Dask scheduler lost it; is it still there?"))
        except BaseException as error:
            call.fail(error)
        self._leave()

    def _result(self, task: Any) -> Any:
        with self._taking:
            if self._is_closed:
                raise CancelledError
            return task.result()

    def _leave(self) -> None:
        """One call less under way; after the last, a suspect has the cluster for itself."""
        with self._lock:
            self._n_under_way -= 1
            alone = not self._n_under_way and self._suspects
            suspect = self._suspects.popleft() if alone else None
        if suspect is not None:
            self._begin(suspect)


def _deaths(n_workers: int) -> str:
    return (
        f"{n_workers} Dask workers died of it; their logs say why, and where memory is short, "
        "fewer threads in each or a smaller block_frames need less"
    )


def _client_class() -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise InvalidInputError(
            "a scheduler needs Dask, which is not installed: pip install 'meshreel[dask]'"
        ) from None
    return Client


def _in_share(function: Callable[..., Result], args: tuple[Any, ...]) -> Result:
    """The call's result, computed in as many cores as its worker has threads."""
    from distributed import get_worker

    n_threads = get_worker().state.nthreads
    if n_threads < n_cores():
        limit_cores(n_threads)
    with one_blas_thread():
        return function(*args)
