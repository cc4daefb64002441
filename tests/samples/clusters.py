"""A local Dask cluster with worker processes that tests may kill."""

from contextlib import contextmanager

from samples.waiting import time_limit


@contextmanager
def local_cluster(n_workers):
    """Start a `LocalCluster` of single-threaded workers."""
    import dask
    import distributed

    settings = {
        "distributed.scheduler.allowed-failures": 1,
        # By default, a worker that is silent for 15 s on a busy machine is never restarted.
        "distributed.deploy.lost-worker-timeout": "1h",
    }
    with dask.config.set(settings):
        with time_limit(60, f"a cluster of {n_workers} workers to start"):
            cluster = distributed.LocalCluster(
                n_workers=n_workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=100,
            )
        try:
            yield cluster
        finally:
            with time_limit(60, "a cluster to close"):
                cluster.close()
