"""A call on the way to a cluster and back."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any


@dataclass(eq=False)
class ClusterCall:
    """A call, its outcome to come, and the task that it is on the cluster.

    `is_suspect` where workers died that had it: it may have been another that they died of.
    """

    function: Callable[..., Any]
    args: tuple[Any, ...]
    outcome: "Future[Any]" = field(default_factory=Future)
    task: Any = None
    is_suspect: bool = False
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
