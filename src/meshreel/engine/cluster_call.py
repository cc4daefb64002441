"""A call on the way to a cluster and back."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any


@dataclass
class ClusterCall:
    """A call, its outcome to come, and the task that it is on the cluster.

    `is_suspect` where workers died that had it: it may have been another that they died of.
    """

    function: Callable[..., Any]
    args: tuple[Any, ...]
    outcome: "Future[Any]" = field(default_factory=Future)
    task: Any = None
    is_suspect: bool = False

    def succeed(self, result: Any) -> None:
        """Give the outcome its result, unless it was cancelled."""
        if self.outcome.set_running_or_notify_cancel():
            self.outcome.set_result(result)

    def fail(self, error: BaseException) -> None:
        """Give the outcome its error, unless it was cancelled."""
        if self.outcome.set_running_or_notify_cancel():
            self.outcome.set_exception(error)

    def cancel(self, outcome: "Future[Any]") -> None:
        """Take the task back if it is the outcome that was cancelled."""
        if outcome.cancelled() and self.task is not None:
            self.task.cancel()
