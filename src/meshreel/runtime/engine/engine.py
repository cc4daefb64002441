"""Independent calls on a pool of workers."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from itertools import islice
from typing import Any, Protocol, TypeVar

from meshreel.errors import InvalidInputError
from meshreel.runtime.threads import n_cores

Result = TypeVar("Result")
Arguments = TypeVar("Arguments", bound=tuple[Any, ...])

IN_FLIGHT_PER_WORKER = 2
"""Calls submitted per worker: one that runs, and the next."""

POLL_S = 0.5


class Workers(Protocol):
    """Workers that execute calls, such as `ProcessWorkers` and `DaskWorkers`."""

    @property
    def n_workers(self) -> int:
        """Number of calls that can run at the same time; it may change, and may be 0."""

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """Submit a call, and return its future.

        Function, arguments and result are pickled. The future raises the exception of the call, or
        `WorkerDiedError` if too many workers died during it, or none were available for too long.
        """

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """Submit a call that failed with `error` to another worker, if there is one.

        A process that ran out of memory is replaced by a new one.
        """

    def close(self, *, at_once: bool) -> None:
        """Release the workers; `at_once`, without waiting for running calls."""


class Engine(AbstractContextManager["Engine"]):
    """Submits calls to workers, with a bounded number of unfinished calls.

    As a context manager, it stops running calls on an exception (including Ctrl-C).

    Parameters
    ----------
    workers : Workers
        `open_engine` creates them.
    """

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._process = os.getpid()

    @property
    def n_workers(self) -> int:
        """Number of calls that can run at the same time; changes with the size of a cluster."""
        return self._workers.n_workers

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """Submit a call, and return its future.

        Parameters
        ----------
        function : callable
            From a module that workers can import (or a `functools.partial` of one). It must be
            idempotent: it is called again if a worker dies.
        *args
            Pickled, like the result: pass large data as paths.

        Raises
        ------
        InvalidInputError
            In a forked child: the workers belong to the parent.
        """
        if os.getpid() != self._process:
            raise InvalidInputError("the engine belongs to the parent process; open one here")
        return self._workers.submit(function, *args)

    def map_in_order(
        self,
        function: Callable[..., Result],
        items: Iterable[tuple[Any, ...]],
        *,
        in_flight: int | None = None,
    ) -> Iterator[Result]:
        """Yield results of ``function(*item)`` in the order of the items.

        Parameters
        ----------
        function : callable
            As in `submit`.
        items : iterable of tuples
            Arguments of each call, consumed on demand: it may be infinite.
        in_flight : int, optional
            Maximum number of submitted calls whose results were not yet yielded. Default: twice
            the number of workers.

        Raises
        ------
        WorkerDiedError
            If too many workers died during a call, or none were available for too long.
        Exception
            From the first call in order that fails; pending calls are cancelled.
        """
        remaining, pending = iter(items), deque[Future[Result]]()
        try:
            while True:
                for item in islice(remaining, self._free_slots(in_flight, len(pending))):
                    pending.append(self.submit(function, *item))
                if not pending:
                    return
                _wait_for_any([pending[0]])
                yield pending.popleft().result()
        finally:
            _cancel(pending)

    def as_completed(
        self,
        function: Callable[..., Result],
        items: Iterable[Arguments],
        *,
        in_flight: int | None = None,
        retry: Callable[[Arguments, BaseException], Arguments | None] | None = None,
    ) -> "Iterator[tuple[Arguments, Future[Result]]]":
        """Yield each item with the future of ``function(*item)``, in order of completion.

        A call that fails does not end the others: the future has its `result` or `exception`.

        Parameters
        ----------
        function, items, in_flight
            As in `map_in_order`.
        retry : callable, optional
            Receives an item and the error of its call, and returns the item to retry, or None to
            give up. Retries follow all first attempts, on another worker if there is one.
        """
        remaining = iter(items)
        retries: deque[tuple[Arguments, BaseException]] = deque()
        pending: dict[Future[Result], Arguments] = {}
        try:
            while True:
                for item in islice(remaining, self._free_slots(in_flight, len(pending))):
                    pending[self.submit(function, *item)] = item
                for _ in range(min(len(retries), self._free_slots(in_flight, len(pending)))):
                    item, failure = retries.popleft()
                    pending[self._workers.submit_elsewhere(failure, function, *item)] = item
                if not pending:
                    return
                for future in _wait_for_any(pending):
                    item, error = pending.pop(future), future.exception() if retry else None
                    next_item = retry(item, error) if retry and error else None
                    if next_item is None or error is None:
                        yield item, future
                    else:
                        retries.append((next_item, error))
                    del future  # releases its result, which may be large, during the wait
        finally:
            _cancel(pending)

    def close(self, *, at_once: bool = False) -> None:
        """Release the workers; `at_once`, without waiting for running calls."""
        if os.getpid() == self._process:  # in a forked child they belong to the parent
            self._workers.close(at_once=at_once)

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        self.close(at_once=kind is not None)

    def _free_slots(self, in_flight: int | None, n_pending: int) -> int:
        if in_flight is not None and in_flight < 1:
            raise InvalidInputError(f"in_flight must be 1 or more; got {in_flight}")
        limit = in_flight or max(1, IN_FLIGHT_PER_WORKER * self.n_workers)
        return max(0, limit - n_pending)


def open_engine(
    n_workers: int | None = None,
    *,
    scheduler: str | None = None,
    max_wait_s: float | None = None,
) -> Engine:
    """Open an engine of processes on this machine, or of the workers of a Dask cluster.

    Parameters
    ----------
    n_workers : int, optional
        Number of processes, which share the cores; default one per core.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.5:8786``.
    max_wait_s : float, optional
        Seconds that calls wait while the scheduler has no workers, before they fail with
        `WorkerDiedError`; default an hour. Meanwhile the logger ``meshreel.engine`` warns at
        growing intervals.

    Raises
    ------
    InvalidInputError
        If both `n_workers` and `scheduler` are given, or `max_wait_s` without `scheduler`; if Dask
        is not installed, or no scheduler answers.

    Notes
    -----
    A ``distributed.LocalCluster`` permanently removes workers that are unreachable for 15 seconds.
    On a busy machine a worker takes longer to restart; to allow that, set
    ``dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"})``.
    """
    if scheduler is None:
        if max_wait_s is not None:
            raise InvalidInputError("max_wait_s needs a scheduler; local processes start at once")
        from meshreel.runtime.engine.processes import ProcessWorkers

        return Engine(ProcessWorkers(n_cores() if n_workers is None else n_workers))
    if n_workers is not None:
        raise InvalidInputError("workers cannot be combined with a scheduler, which has its own")
    from meshreel.runtime.engine.dask_cluster import MAX_WAIT_S, DaskWorkers

    return Engine(DaskWorkers(scheduler, MAX_WAIT_S if max_wait_s is None else max_wait_s))


def _wait_for_any(pending: "Iterable[Future[Result]]") -> "set[Future[Result]]":
    """Wait until one or more futures are done, and return them."""
    while True:
        # With a timeout, because Windows delivers Ctrl-C only between waits.
        done = wait(pending, timeout=POLL_S, return_when=FIRST_COMPLETED).done
        if done:
            return done


def _cancel(pending: "Iterable[Future[Any]]") -> None:
    for future in pending:
        future.cancel()
