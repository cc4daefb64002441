"""Workers of a Dask cluster that do calls; the extra [dask] brings them.

Dask itself gives the calls of a worker that died to another, as often as its scheduler's
``allowed-failures`` says. It suspects all calls that the worker had, those that waited too: here
they get another chance, one after the other, when no other call is under way.

A cluster without workers is waited for: it may be about to grow. That is said, and has a limit:
see `engine.worker_watch`.
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

CONNECT_S = 10.0
"""Seconds in which a scheduler has to answer."""

ANSWER_S = 10.0
"""Seconds in which it then says how many workers there are."""

MAX_WAIT_S = 3600.0
"""Seconds that calls wait for a cluster without workers, unless another number is given."""

_WORKER = "meshreel_worker"
"""Attribute of an error of memory: the address of the worker."""

CLOSE_S = 30.0
"""Seconds that closing waits for a result that is just coming in."""


@dataclass(eq=False)
class _Call:
    """A call, its outcome to come, and the task that it is on the cluster.

    `is_suspect` where workers died that had it: it may have been another that they died of.
    `not_on` is the address of a worker that is not to do it, if there are others.
    """

    function: Callable[..., Any]
    args: tuple[Any, ...]
    outcome: "Future[Any]" = field(default_factory=Future)
    task: Any = None
    is_suspect: bool = False
    not_on: str | None = None
    _is_settled: bool = False
    _settling: threading.Lock = field(default_factory=threading.Lock)

    def succeed(self, result: Any) -> None:
        """Give the outcome its result, unless it was cancelled."""
        if self._may_settle():
            self.outcome.set_result(result)

    def fail(self, error: BaseException) -> None:
        """Give the outcome its error, unless it was cancelled."""
        if self._may_settle():
            self.outcome.set_exception(error)

    def cancel(self, outcome: "Future[Any]") -> None:
        """Take the task back if it is the outcome that was cancelled."""
        if outcome.cancelled():
            self.withdraw()

    def withdraw(self) -> None:
        """Take the task back, without waiting for a scheduler that may not answer."""
        if self.task is not None:
            client = self.task.client
            client.loop.add_callback(client.cancel, [self.task], asynchronous=True)

    def _may_settle(self) -> bool:
        """Whether the outcome is still to be set; true only once."""
        with self._settling:
            is_first, self._is_settled = not self._is_settled, True
        return is_first and self.outcome.set_running_or_notify_cancel()


class DaskWorkers:
    """The workers of the cluster that a scheduler has.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://10.0.0.5:8786``.
    max_wait_s : float, default 3600
        Seconds that calls wait while the cluster has no workers. Then they fail, and further ones
        at once, until there are some.

    Raises
    ------
    InvalidInputError
        If Dask is not installed, no scheduler answers there, or the seconds are not above 0.
    """

    def __init__(self, address: str, max_wait_s: float = MAX_WAIT_S) -> None:
        if not 0 < max_wait_s < float("inf"):
            raise InvalidInputError(f"max_wait_s must be finite and above 0; got {max_wait_s}")
        client = _client_class()
        self._lock = threading.Lock()
        self._under_way: set[_Call] = set()
        self._suspects: deque[_Call] = deque()
        self._taking = threading.Lock()  # held while a result is taken over from the cluster
        self._is_closed = False
        try:
            self._client = client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise InvalidInputError(
                f"no Dask scheduler answers at {address!r} ({error}); give its address as it "
                "prints it, such as tcp://10.0.0.5:8786"
            ) from None
        self._watch = WorkerWatch(
            address, self._count, lambda: len(self._under_way), self._give_up, max_wait_s
        )
        self._watch.start()

    @property
    def n_workers(self) -> int:
        """Threads of all workers that take calls now; 0 too where the scheduler does not answer."""
        return self._count().n_threads

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """The outcome to come of one call on the cluster."""
        return self._submitted(_Call(function, args))

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """As `submit`, on another worker than that whose memory was too little for the error.

        Where workers died of it, it is a suspect from the start.
        """
        is_suspect = isinstance(error, WorkerDiedError)
        not_on = getattr(error, _WORKER, None)
        return self._submitted(_Call(function, args, is_suspect=is_suspect, not_on=not_on))

    def _submitted(self, call: _Call) -> "Future[Any]":
        refusal = self._watch.refusal()
        if refusal is not None:
            call.fail(WorkerDiedError(refusal))
            return call.outcome
        call.outcome.add_done_callback(call.cancel)  # this also keeps Dask from forgetting it
        self._begin(call)
        return call.outcome

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster; calls that still run there end without an effect."""
        self._is_closed = True
        self._watch.close()
        # A client that closes under a result that is being taken never gives it; and all clients
        # of a process share the one thread that waits for it.
        is_quiet = self._taking.acquire(timeout=CLOSE_S)
        try:
            self._client.close()
        finally:
            if is_quiet:
                self._taking.release()

    def _begin(self, call: _Call) -> None:
        with self._lock:
            self._under_way.add(call)
        if call.outcome.cancelled():
            self._leave(call)
            return
        try:
            others = self._others(call.not_on)
            call.task = self._client.submit(
                _in_share, call.function, call.args,
                pure=False, workers=others, allow_other_workers=bool(others),
            )  # fmt: skip
            call.task.add_done_callback(partial(self._end, call))
        except Exception as error:
            call.fail(error)
            self._leave(call)

    def _others(self, not_on: str | None) -> list[str] | None:
        """Addresses of the workers but one; None, which means any, where there are no others."""
        if not_on is None:
            return None
        running = self._client.sync(self._client.scheduler.ncores_running)
        return [address for address in running if address != not_on] or None

    def _end(self, call: _Call, task: Any) -> None:
        """Give the call the outcome of its task; set a suspect aside, to be called again alone."""
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
        self._leave(call)

    def _result(self, task: Any) -> Any:
        with self._taking:
            if self._is_closed:
                raise CancelledError
            return task.result()

    def _leave(self, call: _Call) -> None:
        """One call less under way; after the last, a suspect has the cluster for itself."""
        with self._lock:
            self._under_way.discard(call)
            alone = not self._under_way and self._suspects
            suspect = self._suspects.popleft() if alone else None
        if suspect is not None:
            self._begin(suspect)

    def _count(self) -> WorkerCount:
        scheduler, ask = self._client.scheduler, self._client.sync
        try:
            running = ask(scheduler.ncores_running, callback_timeout=ANSWER_S)
            if running:
                return WorkerCount(sum(running.values()))
            return WorkerCount(0, n_paused=len(ask(scheduler.ncores, callback_timeout=ANSWER_S)))
        except (OSError, RuntimeError):  # of the network, too late, or of a client that is closed
            return WorkerCount(0, answers=False)

    def _give_up(self, reason: str) -> None:
        """Fail all calls under way, and the suspects behind them."""
        with self._lock:
            calls = [*self._under_way, *self._suspects]
            self._under_way.clear()
            self._suspects.clear()
        for call in calls:
            call.fail(WorkerDiedError(reason))
            call.withdraw()


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
        try:
            return function(*args)
        except MemoryError as error:
            setattr(error, _WORKER, get_worker().address)
            raise
