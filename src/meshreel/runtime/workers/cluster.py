"""The executor of a Dask cluster; needs the extra [dask].

Dask itself moves the calls of a dead worker to another, up to ``distributed.scheduler.
allowed-failures`` times. Calls wait for a cluster without workers, by default without a limit:
``distributed.scheduler.no-workers-timeout`` sets one.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar
from weakref import WeakSet

from meshreel.errors import InvalidInputError
from meshreel.runtime.threads import limit_cores

CONNECT_TIMEOUT_S = 10.0
"""Seconds to wait for the connection to a scheduler."""

MAX_CALLS = 4096
"""Maximum number of pending calls."""

T = TypeVar("T")


@contextmanager
def cluster_executor(address: str) -> Iterator[tuple[Executor, int]]:
    """Connect to a cluster; yield its executor, and its number of threads at this moment.

    On an exception (including Ctrl-C), the context cancels all calls.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as ``tcp://10.0.0.5:8786``.

    Raises
    ------
    InvalidInputError
        If Dask is not installed, no scheduler answers, or its workers lack meshreel.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise InvalidInputError(
            "a scheduler needs Dask, which is not installed; pip install 'meshreel[dask]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidInputError(
            f"no Dask scheduler answers at {address!r} ({error}); use the address that it "
            "prints, such as tcp://10.0.0.5:8786"
        ) from None

    class LimitCores(distributed.WorkerPlugin):  # type: ignore[misc]
        """Makes each worker use as many cores as it has threads, also those that start later."""

        name = "meshreel-cores"

        def setup(self, worker: Any) -> None:
            limit_cores(worker.state.nthreads)

    with client:
        try:
            client.register_plugin(LimitCores())
        except ImportError as error:
            raise InvalidInputError(
                f"the Dask workers at {address} cannot import meshreel ({error}); install the "
                "same version there"
            ) from None
        n_threads = sum(client.nthreads().values())
        executor = _ClusterExecutor(client)
        try:
            yield executor, n_threads
        except BaseException:
            executor.cancel()
            raise
        finally:
            executor.shutdown()


class _ClusterExecutor(ThreadPoolExecutor):
    """Runs calls on a cluster; a thread of this process waits for the result of each.

    Dask's own executor never completes a call whose result was lost with its worker if the next
    worker dies, too (distributed 2026.8, `cfexecutor._cascade_future`).
    """

    def __init__(self, client: Any) -> None:
        super().__init__(MAX_CALLS, "meshreel-cluster")
        self._client = client
        self._calls: WeakSet[Any] = WeakSet()

    def submit(self, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Submit a call to the cluster; raises RuntimeError after shutdown."""
        call = self._client.submit(function, *args, **kwargs, pure=False)
        self._calls.add(call)
        return super().submit(call.result)

    def cancel(self) -> None:
        """Cancel all calls that are not done."""
        self._client.cancel([call for call in self._calls if not call.done()])
