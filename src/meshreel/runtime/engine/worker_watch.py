"""A cluster without workers is waited for, but neither in silence nor for ever."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

LOGGER = logging.getLogger("meshreel.engine")

LOOK_EVERY_S = 1.0
"""Seconds from one look at the cluster to the next."""

FIRST_WORD_S = 15.0
"""Seconds without workers after which that is logged: a worker that died is back sooner."""

MOST_SILENT_S = 300.0
"""Each wait for the next word is twice as long as that before, but not longer than this."""


@dataclass(frozen=True)
class WorkerCount:
    """The workers of a cluster.

    Attributes
    ----------
    n_threads : int
        Calls that they take at the same time.
    n_paused : int
        Workers that take none, for their memory is nearly full.
    answers : bool
        Whether the cluster could be asked.
    """

    n_threads: int
    n_paused: int = 0
    answers: bool = True

    @property
    def lack(self) -> str:
        """The problem in words where there are no threads, as in "it has had no workers"."""
        if not self.answers:
            return "has not answered"
        if self.n_paused:
            return f"has had no workers but {self.n_paused} paused (their memory is nearly full)"
        return "has had no workers"


class WorkerWatch:
    """Looks at a cluster while calls wait there; logs that it has no workers, and ends the wait.

    Words go to the logger ``meshreel.engine`` as warnings, which appear on stderr unless logging
    is set up otherwise.

    Parameters
    ----------
    address : str
        Of the scheduler.
    count : callable
        Gives the `WorkerCount` of now.
    n_waiting : callable
        Gives the number of calls under way.
    give_up : callable
        Called with the reason when calls have waited for too long.
    max_wait_s : float
        How long that is.
    """

    def __init__(
        self,
        address: str,
        count: Callable[[], WorkerCount],
        n_waiting: Callable[[], int],
        give_up: Callable[[str], None],
        max_wait_s: float,
    ) -> None:
        self._address, self._max_wait_s = address, max_wait_s
        self._count, self._n_waiting, self._give_up = count, n_waiting, give_up
        self._since: float | None = None  # when calls began to wait
        self._next_word_s = FIRST_WORD_S
        self._refusal: str | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="meshreel-watch", daemon=True)

    def start(self) -> None:
        """Look every second from now on."""
        self._thread.start()

    def close(self) -> None:
        """Look no more."""
        self._closed.set()

    def refusal(self) -> str | None:
        """Why further calls are refused, once waiting was given up; None while they may wait."""
        if self._refusal is not None and self._count().n_threads:
            self._workers_are_there()
        return self._refusal

    def look(self, now: float) -> None:
        """Look at the cluster at a time in seconds; log or give up when that is due."""
        n_waiting = self._n_waiting()
        if not n_waiting:
            self._since = None
            return
        count = self._count()
        if count.n_threads:
            self._workers_are_there()
            return
        since = self._since  # once, for `refusal` may be asked in another thread meanwhile
        if since is None:
            since, self._next_word_s = now, FIRST_WORD_S
            self._since = since
        waited_s = now - since
        if waited_s >= self._max_wait_s:
            self._refusal = self._reason(count, waited_s)
            self._since = None
            self._give_up(self._refusal)
        elif waited_s >= self._next_word_s:
            LOGGER.warning(self._word(count, n_waiting, waited_s))
            self._next_word_s = waited_s + min(waited_s, MOST_SILENT_S)

    def _run(self) -> None:
        while not self._closed.wait(LOOK_EVERY_S):
            self.look(time.monotonic())

    def _workers_are_there(self) -> None:
        if self._since is not None and self._next_word_s > FIRST_WORD_S:
            LOGGER.warning(f"the Dask cluster at {self._address} has workers again")
        self._since = self._refusal = None

    def _word(self, count: WorkerCount, n_waiting: int, waited_s: float) -> str:
        calls = "1 call waits" if n_waiting == 1 else f"{n_waiting} calls wait"
        return (
            f"the Dask cluster at {self._address} {count.lack} for {_duration(waited_s)}; {calls}. "
            f"{self._remedy} Ctrl-C stops; after {_duration(self._max_wait_s)} they are given up"
        )

    def _reason(self, count: WorkerCount, waited_s: float) -> str:
        return (
            f"the Dask cluster at {self._address} {count.lack} for {_duration(waited_s)}, and "
            f"calls were given up. {self._remedy} Then run this again"
        )

    @property
    def _remedy(self) -> str:
        return f"'dask worker {self._address}' starts a worker."


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} minutes"
