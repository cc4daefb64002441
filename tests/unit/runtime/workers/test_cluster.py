"""Calls on a local Dask cluster of two worker processes, which may die."""

import _thread
import os
import signal
import sys
import threading
import time
from concurrent.futures import CancelledError

import pytest

from meshreel.app.batch.encode_input import worker_died
from meshreel.errors import InvalidInputError
from meshreel.runtime.workers.cluster import cluster_executor
from meshreel.runtime.workers.executors import executor_of
from samples.clusters import local_cluster
from samples.tasks import cores_and_blas_threads, die_always, process_id, slow_square, square
from samples.waiting import wait_until

distributed = pytest.importorskip("distributed", reason="the extra [dask] is not installed")

pytestmark = [
    pytest.mark.slow,
    # Dask leaves resources open when workers and schedulers are killed.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module")
def cluster():
    with local_cluster(2) as running:
        yield running


@pytest.fixture
def executor(cluster):
    wait_until(lambda: len(cluster.scheduler_info["workers"]) == 2, "a killed worker to restart")
    with cluster_executor(cluster.scheduler_address) as (opened, n_workers):
        assert n_workers == 2
        yield opened


def test_equal_calls_run_separately(executor):
    outcomes = [executor.submit(process_id) for _ in range(4)]
    assert os.getpid() not in {outcome.result(60) for outcome in outcomes}
    assert len({id(outcome) for outcome in outcomes}) == 4


def test_workers_use_as_many_cores_as_they_have_threads(executor):
    cores, blas = executor.submit(cores_and_blas_threads).result(60)
    assert cores == 1
    assert set(blas) == {1}


def test_no_call_is_lost_when_a_worker_is_killed_from_outside(executor):
    process = executor.submit(process_id).result(60)
    outcomes = [executor.submit(slow_square, number, 0.1) for number in range(20)]
    assert outcomes[0].result(60) == 0
    os.kill(process, signal.SIGKILL)
    assert [outcome.result(60) for outcome in outcomes] == [n * n for n in range(20)]


def test_other_calls_succeed_when_a_call_kills_its_workers(executor):
    deadly = executor.submit(die_always)
    assert worker_died(deadly.exception(120))
    assert [executor.submit(square, number).result(60) for number in (5, 6)] == [25, 36]


def test_a_call_whose_result_is_lost_fails(executor, monkeypatch):
    """Dask reports it when the result is fetched, after the call is done."""

    async def lost(*_, **__):
        raise distributed.KilledWorker("square", None, 2)

    monkeypatch.setattr(distributed.Client, "_gather", lost)
    assert worker_died(executor.submit(square, 2).exception(60))


def test_context_closes_immediately_while_calls_run_and_wait(cluster):
    """Two calls run and two wait; Dask chooses the order, because it steals work."""

    def interrupted():
        with cluster_executor(cluster.scheduler_address) as (executor, _):
            threading.Timer(1.0, _thread.interrupt_main).start()
            outcomes = [executor.submit(slow_square, 2, 600) for _ in range(4)]
            wait_until(outcomes[0].done, "a call")

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < 60


def test_calls_wait_when_workers_start_later():
    with (
        local_cluster(0) as cluster,
        cluster_executor(cluster.scheduler_address) as (executor, n_workers),
    ):
        outcome = executor.submit(cores_and_blas_threads)
        cluster.scale(1)
        assert outcome.result(60)[0] == 1
        assert n_workers == 0


def test_calls_fail_when_the_scheduler_stops():
    with local_cluster(1) as cluster, cluster_executor(cluster.scheduler_address) as (executor, _):
        assert executor.submit(square, 2).result(60) == 4
        outcome = executor.submit(slow_square, 2, 600)
        cluster.close()
        with pytest.raises(CancelledError):
            outcome.result(120)


def test_progress_says_that_a_cluster_has_no_workers():
    stages = []
    with local_cluster(0) as cluster:
        address = cluster.scheduler_address
        with executor_of(None, address, lambda stage, _: stages.append(stage)) as (_, n_workers):
            assert n_workers == 0
    assert stages == [f"waiting for workers; 'dask worker {address}' starts one"]


def test_cluster_executor_fails_when_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("meshreel.runtime.workers.cluster.CONNECT_TIMEOUT_S", 0.5)
    with (
        pytest.raises(InvalidInputError, match="no Dask scheduler answers at 'tcp://127"),
        cluster_executor("tcp://127.0.0.1:9"),
    ):
        pass


def test_error_names_the_extra_when_dask_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[dask\]'"),
        cluster_executor("tcp://127.0.0.1:8786"),
    ):
        pass
