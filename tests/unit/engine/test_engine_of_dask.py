"""Calls on a Dask cluster of two workers on this machine, each a process that may die."""

import os
import signal
import sys
import time
from functools import partial

import pytest

from meshreel.engine.engine import open_engine
from meshreel.errors import InvalidInputError, WorkerDiedError
from sample_tasks import (
    cores_and_blas_threads,
    die_always,
    die_once_if,
    die_or_square,
    fail,
    process_id,
    slow_square,
    square,
)

distributed = pytest.importorskip("distributed", reason="the extra [dask] is not installed")

pytestmark = [
    pytest.mark.slow,
    # What Dask itself leaves behind where workers and schedulers are killed.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module")
def cluster():
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=100,
        ) as made,
    ):
        yield made


@pytest.fixture
def engine(cluster):
    with open_engine(scheduler=cluster.scheduler_address) as opened:
        for _ in range(200):  # a worker that a test killed comes back
            if opened.n_workers == 2:
                break
            time.sleep(0.1)
        yield opened


def test_engine_has_the_workers_of_the_cluster(engine):
    assert engine.n_workers == 2


def test_map_in_order_keeps_the_order_when_later_calls_end_first(engine):
    items = [(number, 0.3 if number == 0 else 0.0) for number in range(10)]
    assert list(engine.map_in_order(slow_square, items)) == [n * n for n in range(10)]


def test_calls_are_made_each_time_when_they_are_equal(engine):
    found = [engine.submit(process_id) for _ in range(4)]
    assert os.getpid() not in {outcome.result(60) for outcome in found}
    assert len({id(outcome) for outcome in found}) == 4


def test_submit_raises_the_error_of_the_call(engine):
    with pytest.raises(ValueError, match="no such thing"):
        engine.submit(fail, "no such thing").result(60)


def test_workers_compute_in_as_many_cores_as_they_have_threads(engine):
    cores, blas = engine.submit(cores_and_blas_threads).result(60)
    assert cores == 1
    assert set(blas) == {1}


def test_map_in_order_recovers_when_a_worker_is_killed_in_the_middle(engine, tmp_path):
    call = partial(die_once_if, folder=str(tmp_path), deadly={4})
    results = engine.map_in_order(call, [(number,) for number in range(10)], in_flight=2)
    assert list(results) == [n * n for n in range(10)]
    assert len(list(tmp_path.iterdir())) == 1


def test_map_in_order_recovers_when_a_worker_is_killed_from_outside(engine):
    process = engine.submit(process_id).result(60)
    results = engine.map_in_order(slow_square, [(number, 0.1) for number in range(20)])
    assert next(results) == 0
    os.kill(process, signal.SIGKILL)
    assert list(results) == [n * n for n in range(1, 20)]


def test_call_is_given_up_when_it_kills_its_workers(engine):
    with pytest.raises(WorkerDiedError, match="2 Dask workers died of it"):
        engine.submit(die_always).result(120)
    assert engine.submit(square, 5).result(60) == 25


def test_others_are_not_blamed_when_a_call_kills_its_workers(engine):
    outcomes = dict(engine.as_completed(die_or_square, [(number, 4) for number in range(12)]))
    failed = [item for item, outcome in outcomes.items() if outcome.exception()]
    assert failed == [(4, 4)]
    assert isinstance(outcomes[4, 4].exception(), WorkerDiedError)


def test_call_not_yet_begun_is_cancelled_when_the_engine_is_left_by_an_exception(cluster):
    def interrupted():
        with open_engine(scheduler=cluster.scheduler_address) as engine:
            results = engine.map_in_order(slow_square, [(1, 0.0), *[(2, 600)] * 3])
            next(results)
            raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < 60


def test_engine_is_refused_when_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("meshreel.engine.dask_cluster.CONNECT_S", 0.5)
    with pytest.raises(InvalidInputError, match="no Dask scheduler answers at 'tcp://127"):
        open_engine(scheduler="tcp://127.0.0.1:9")


def test_engine_is_refused_with_the_remedy_when_dask_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[dask\]'"):
        open_engine(scheduler="tcp://127.0.0.1:8786")


def test_calls_fail_instead_of_hanging_when_the_scheduler_goes():
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=100
        ) as cluster,
        open_engine(scheduler=cluster.scheduler_address) as engine,
    ):
        assert engine.submit(square, 2).result(60) == 4
        outcome = engine.submit(slow_square, 2, 600)
        cluster.close()
        with pytest.raises(WorkerDiedError, match="scheduler"):
            outcome.result(120)
