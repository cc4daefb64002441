"""Bounded waiting for a cluster without workers, with warnings."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from meshreel.runtime.counting import duration_text

LOGGER = logging.getLogger("meshreel.engine")

POLL_S = 1.0
"""Seconds between two polls of the cluster."""

FIRST_WARNING_S = 15.0
"""Seconds without workers before the first warning: a worker that died restarts sooner."""

MAX_WARNING_INTERVAL_S = 300.0
"""The interval between warnings doubles up to this number of seconds."""


@dataclass(frozen=True)
class WorkerCount:
    """The workers of a cluster.

    Attributes
    ----------
    n_threads : int
        Calls that they can run at the same time.
    n_paused : int
        Workers that accept no calls because their memory is nearly full.
    is_reachable : bool
        Whether the scheduler answered.
    """

    n_threads: int
    n_paused: int = 0
    is_reachable: bool = True

    @property
    def problem(self) -> str:
        """Why no threads are available, as the predicate of a sentence: "has had no workers"."""
        if not self.is_reachable:
            return "has not answered"
        if self.n_paused:
            return f"has had no workers but {self.n_paused} paused (their memory is nearly full)"
        return "has had no workers"


class WorkerWatch:
    """Polls a cluster while calls wait; warns if it has no workers, and ends the wait.

    Warnings go to the logger ``meshreel.engine``, by default to stderr.

    Parameters
    ----------
    address : str
        Address of the scheduler.
    count : callable
        Returns the current `WorkerCount`.
    n_waiting : callable
        Returns the number of unfinished calls.
    abandon : callable
        Called with the reason after `max_wait_s` without workers.
    max_wait_s : float
    """

    def __init__(
        self,
        address: str,
        count: Callable[[], WorkerCount],
        n_waiting: Callable[[], int],
        abandon: Callable[[str], None],
        max_wait_s: float,
    ) -> None:
        self._address, self._max_wait_s = address, max_wait_s
        self._count, self._n_waiting, self._abandon = count, n_waiting, abandon
        self._waiting_since: float | None = None  # when calls began to wait
        self._next_warning_s = FIRST_WARNING_S
        self._refusal: str | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="meshreel-watch", daemon=True)

    def start(self) -> None:
        """Start polling every `POLL_S` seconds."""
        self._thread.start()

    def close(self) -> None:
        """Stop polling."""
        self._closed.set()

    def refusal(self) -> str | None:
        """Why further calls are refused after calls were abandoned; None while calls may wait."""
        if self._refusal is not None and self._count().n_threads:
            self._reset()
        return self._refusal

    def poll(self, now: float) -> None:
        """Poll the cluster at time `now`, in seconds; warn or abandon calls if due."""
        n_waiting = self._n_waiting()
        if not n_waiting and self._waiting_since is None:
            return
        count = self._count()
        if count.n_threads:
            self._reset()  # also if all calls have finished since the last poll
            return
        if not n_waiting:
            self._waiting_since = None
            return
        start_s = self._waiting_since  # a copy: another thread may call `refusal` meanwhile
        if start_s is None:
            start_s, self._next_warning_s = now, FIRST_WARNING_S
            self._waiting_since = start_s
        waited_s = now - start_s
        if waited_s >= self._max_wait_s:
            self._refusal = self._reason(count, waited_s)
            self._waiting_since = None
            self._abandon(self._refusal)
        elif waited_s >= self._next_warning_s:
            LOGGER.warning(self._warning(count, n_waiting, waited_s))
            self._next_warning_s = waited_s + min(waited_s, MAX_WARNING_INTERVAL_S)

    def _run(self) -> None:
        while not self._closed.wait(POLL_S):
            self.poll(time.monotonic())

    def _reset(self) -> None:
        if self._waiting_since is not None and self._next_warning_s > FIRST_WARNING_S:
            LOGGER.warning(f"the Dask cluster at {self._address} has workers again")
        self._waiting_since = self._refusal = None

    def _warning(self, count: WorkerCount, n_waiting: int, waited_s: float) -> str:
        calls = "1 call waits" if n_waiting == 1 else f"{n_waiting} calls wait"
        return (
            f"the Dask cluster at {self._address} {count.problem} for {duration_text(waited_s)}; "
            f"{calls}. {self._remedy} Ctrl-C stops; after {duration_text(self._max_wait_s)} they "
            "are abandoned"
        )

    def _reason(self, count: WorkerCount, waited_s: float) -> str:
        return (
            f"the Dask cluster at {self._address} {count.problem} for {duration_text(waited_s)}, "
            f"and calls were abandoned. {self._remedy} Then run this again"
        )

    @property
    def _remedy(self) -> str:
        return f"'dask worker {self._address}' starts a worker."
