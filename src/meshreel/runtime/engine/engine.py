"""Calls on the workers of any executor, with results in the order of the calls."""

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from meshreel.errors import WorkerDiedError

Result = TypeVar("Result")

CALLS_PER_WORKER = 2
"""Calls submitted per worker: one that runs, and the next."""

POLL_S = 0.5


@dataclass(frozen=True)
class Engine:
    """An executor, and the number of calls that it runs at the same time."""

    executor: Executor
    n_workers: int

    def map_in_order(
        self, function: Callable[..., Result], items: Iterable[tuple[Any, ...]]
    ) -> Iterator[Result]:
        """Yield results of ``function(*item)`` in the order of the items.

        The items are consumed on demand: at most `CALLS_PER_WORKER` calls per worker are submitted
        whose results were not yet yielded. The first error in order is raised, and cancels the
        pending calls.
        """
        remaining, pending = iter(items), deque[Future[Result]]()
        limit = CALLS_PER_WORKER * max(1, self.n_workers)
        try:
            while True:
                for item in islice(remaining, limit - len(pending)):
                    pending.append(self.executor.submit(function, *item))
                if not pending:
                    return
                wait_for_any([pending[0]])
                yield pending.popleft().result()
        finally:
            for future in pending:
                future.cancel()


def wait_for_any(futures: "Iterable[Future[Result]]") -> "set[Future[Result]]":
    """Wait until one or more futures are done, and return them."""
    while True:
        # With a timeout, because Windows delivers Ctrl-C only between waits.
        done = wait(futures, timeout=POLL_S, return_when=FIRST_COMPLETED).done
        if done:
            return done


def worker_died(error: BaseException) -> bool:
    """Whether a call failed because a worker died: our process, another pool's, or Dask's."""
    dask = sys.modules.get("distributed")
    kinds = (WorkerDiedError, BrokenExecutor, *([dask.KilledWorker] if dask else []))
    return isinstance(error, kinds)
