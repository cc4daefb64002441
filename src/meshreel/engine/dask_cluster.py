"""Workers of a Dask cluster that do calls; the extra [dask] brings them.

Dask itself gives the calls of a worker that died to another, as often as its scheduler's
``allowed-failures`` says. A cluster without workers is waited for: it may be about to grow.
"""

from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from typing import Any, TypeVar

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.threads import limit_cores, n_cores, one_blas_thread

Result = TypeVar("Result")

CONNECT_S = 10.0
"""Seconds in which a scheduler has to answer."""


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
        outcome: Future[Result] = Future()
        task = self._client.submit(_in_share, function, args, pure=False)
        # Holding the task in the outcome keeps Dask from forgetting it.
        outcome.add_done_callback(partial(_cancel_too, task))
        task.add_done_callback(partial(_pass_on, outcome))
        return outcome

    def close(self, *, at_once: bool) -> None:
        """Leave the cluster; calls that still run there end without an effect."""
        self._client.close()


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


def _pass_on(outcome: "Future[Any]", task: Any) -> None:
    """Give the outcome what the task came to."""
    from distributed import KilledWorker

    if not outcome.set_running_or_notify_cancel():
        return
    try:
        outcome.set_result(task.result())
    except KilledWorker as error:
        n_deaths = error.allowed_failures + 1
        outcome.set_exception(
            WorkerDiedError(
                f"{n_deaths} Dask workers died of it; their logs say why, and where memory is "
                "short, fewer threads in each or a smaller block_frames need less"
            )
        )
    except CancelledError:
        outcome.set_exception(WorkerDiedError("the Dask scheduler lost it; is it still there?"))
    except BaseException as error:
        outcome.set_exception(error)


def _cancel_too(task: Any, outcome: "Future[Any]") -> None:
    if outcome.cancelled():
        task.cancel()
