"""Independent calls on many workers, whatever the workers are."""

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
"""Calls handed out for each worker: one that runs, and one that is there when it ends."""

POLL_S = 0.5


class Workers(Protocol):
    """Workers that do calls, wherever they are."""

    @property
    def n_workers(self) -> int:
        """Calls that run at the same time; it may change, and may be 0 for a while."""

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """The outcome to come of one call.

        Function, arguments and result are pickled. Its exception is the call's own, or
        `WorkerDiedError` where the call, done again each time, outlived its workers, or where
        there were none for too long.
        """

    def submit_elsewhere(
        self, error: BaseException, function: Callable[..., Result], /, *args: Any
    ) -> "Future[Result]":
        """As `submit`, for work that failed with an error: not where it was, if there are others.

        Of a process that ran out of memory, a new one is another.
        """

    def close(self, *, at_once: bool) -> None:
        """Let the workers go; `at_once`, without waiting for calls that still run."""


class Engine(AbstractContextManager["Engine"]):
    """Calls on many workers, with a bounded number of them under way.

    As a context manager, left by an exception (ctrl-C included), it stops calls that still run.

    Parameters
    ----------
    workers : Workers
        `ProcessWorkers` or `DaskWorkers`; `open_engine` makes them.
    """

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._process = os.getpid()

    @property
    def n_workers(self) -> int:
        """Calls that run at the same time; it may change while a cluster grows or shrinks."""
        return self._workers.n_workers

    def submit(self, function: Callable[..., Result], /, *args: Any) -> "Future[Result]":
        """The outcome to come of one call, as `concurrent.futures` has it.

        Parameters
        ----------
        function : callable
            Of a module that workers can import (or a `functools.partial` of one). It may be called
            again where a worker died, so that it must not matter how often it is.
        *args
            Pickled, as the result is: large ones are better named by a path.

        Raises
        ------
        InvalidInputError
            In a forked child: its parent has the workers and the threads that serve them.
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
        """Results of ``function(*item)``, in the order of the items.

        Parameters
        ----------
        function : callable
            As for `submit`.
        items : iterable of tuples
            The arguments of each call. Taken when there is room, so that it may be without end.
        in_flight : int, optional
            Calls, from the first whose result was not yet taken, that are handed out at most;
            results that wait for an earlier one count. Default: twice the number of workers.

        Raises
        ------
        WorkerDiedError
            If a call outlived its workers too often, or there were none for too long.
        Exception
            That of the first call, by order, that fails; calls not yet begun are cancelled.
        """
        remaining, pending = iter(items), deque[Future[Result]]()
        try:
            while True:
                for item in islice(remaining, self._room(in_flight, len(pending))):
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
        again: Callable[[Arguments, BaseException], Arguments | None] | None = None,
    ) -> "Iterator[tuple[Arguments, Future[Result]]]":
        """Each item with the outcome of ``function(*item)``, as they come to an end.

        A call that fails does not end the others: ask the outcome for its `result` or its
        `exception`.

        Parameters
        ----------
        function, items, in_flight
            As for `map_in_order`.
        again : callable, optional
            Takes an item and the error of its call, and gives the item of another try, or None
            where there is none. That is done once all items are handed out, and on another worker
            if there is one.
        """
        remaining = iter(items)
        tries: deque[tuple[Arguments, BaseException]] = deque()
        pending: dict[Future[Result], Arguments] = {}
        try:
            while True:
                for item in islice(remaining, self._room(in_flight, len(pending))):
                    pending[self.submit(function, *item)] = item
                for _ in range(min(len(tries), self._room(in_flight, len(pending)))):
                    item, failure = tries.popleft()
                    pending[self._workers.submit_elsewhere(failure, function, *item)] = item
                if not pending:
                    return
                for outcome in _wait_for_any(pending):
                    item, error = pending.pop(outcome), outcome.exception() if again else None
                    another = again(item, error) if again and error else None
                    if another is None or error is None:
                        yield item, outcome
                    else:
                        tries.append((another, error))
                    del outcome  # its result may be large, and the next is waited for
        finally:
            _cancel(pending)

    def close(self, *, at_once: bool = False) -> None:
        """Let the workers go; `at_once`, without waiting for calls that still run."""
        if os.getpid() == self._process:  # else this is a forked child: the parent needs them
            self._workers.close(at_once=at_once)

    def __exit__(self, kind: type[BaseException] | None, *details: object) -> None:
        self.close(at_once=kind is not None)

    def _room(self, in_flight: int | None, n_pending: int) -> int:
        """Calls that may be handed out beside those pending."""
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
    """An engine of processes on this machine, or of the workers of a Dask cluster.

    Parameters
    ----------
    n_workers : int, optional
        Processes; default one for each core. They share the cores among them.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.5:8786``; its workers do the calls.
    max_wait_s : float, optional
        Seconds that calls wait while the scheduler has no workers, before they fail with
        `WorkerDiedError`; default an hour. Until then the logger ``meshreel.engine`` says from
        time to time that they wait, and for how long.

    Raises
    ------
    InvalidInputError
        If workers and a scheduler are given, or `max_wait_s` without a scheduler, Dask is not
        installed, or no scheduler answers.

    Notes
    -----
    A ``distributed.LocalCluster`` that you start for it gives up each worker that is away for 15
    seconds, for good. On a busy machine a worker that died takes longer to come back:
    ``dask.config.set({"distributed.deploy.lost-worker-timeout": "1h"})`` lets it.
    """
    if scheduler is None:
        if max_wait_s is not None:
            raise InvalidInputError(
                "max_wait_s is of a scheduler; processes here are not waited for"
            )
        from meshreel.runtime.engine.processes import ProcessWorkers

        return Engine(ProcessWorkers(n_cores() if n_workers is None else n_workers))
    if n_workers is not None:
        raise InvalidInputError("workers are the scheduler's to count; give one of the two")
    from meshreel.runtime.engine.dask_cluster import MAX_WAIT_S, DaskWorkers

    return Engine(DaskWorkers(scheduler, MAX_WAIT_S if max_wait_s is None else max_wait_s))


def _wait_for_any(pending: "Iterable[Future[Result]]") -> "set[Future[Result]]":
    """Those that are done, once one is."""
    while True:
        # In pieces, because on Windows ctrl-C is heard only between them.
        done = wait(pending, timeout=POLL_S, return_when=FIRST_COMPLETED).done
        if done:
            return done


def _cancel(pending: "Iterable[Future[Any]]") -> None:
    for outcome in pending:
        outcome.cancel()
