"""The executor that options choose: worker processes of this machine, or a Dask cluster."""

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from typing import TypeVar

from meshreel.runtime.progress import Progress
from meshreel.runtime.workers import processes
from meshreel.runtime.workers.cluster import cluster_executor

POLL_S = 0.5

Result = TypeVar("Result")


@contextmanager
def executor_of(
    workers: int | None, scheduler: str | None, progress: Progress
) -> Iterator[tuple[Executor | None, int]]:
    """Context manager for an executor and the number of its workers; None for this process."""
    if scheduler is not None:
        with cluster_executor(scheduler) as (executor, n_workers):
            if not n_workers:
                progress(f"waiting for workers; 'dask worker {scheduler}' starts one", 0.0)
            yield executor, n_workers
    elif workers is not None:
        with processes.ProcessExecutor(workers) as executor:
            yield executor, workers
    else:
        yield None, 1


def completed(futures: Iterable[Future[Result]]) -> set[Future[Result]]:
    """Wait until a future is done, or for half a second; return all that are done."""
    # With a timeout, because Windows delivers Ctrl-C only between waits.
    return wait(futures, POLL_S, FIRST_COMPLETED).done
