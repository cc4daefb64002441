"""Calls on a local Dask cluster of two worker processes, which may die."""

import _thread
import os
import signal
import sys
import threading
import time
from functools import partial

import pytest

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.runtime.engine.engine import open_engine
from samples.clusters import local_cluster
from samples.tasks import (
    cores_and_blas_threads,
    die_always,
    die_once_if,
    die_or_square,
    fail,
    process_id,
    slow_square,
    square,
)
from samples.waiting import time_limit, wait_until

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
def engine(cluster):
    with open_engine(scheduler=cluster.scheduler_address) as opened:
        wait_until(lambda: opened.n_workers == 2, "the killed worker to restart")
        yield opened


def test_engine_has_the_workers_of_the_cluster(engine):
    assert engine.n_workers == 2


def test_map_in_order_keeps_the_order_when_later_calls_end_first(engine):
    items = [(number, 0.3 if number == 0 else 0.0) for number in range(10)]
    assert list(engine.map_in_order(slow_square, items)) == [n * n for n in range(10)]


def test_equal_calls_run_separately(engine):
    outcomes = [engine.submit(process_id) for _ in range(4)]
    assert os.getpid() not in {outcome.result(60) for outcome in outcomes}
    assert len({id(outcome) for outcome in outcomes}) == 4


def test_submit_raises_the_error_of_the_call(engine):
    with pytest.raises(ValueError, match="no such thing"):
        engine.submit(fail, "no such thing").result(60)


def test_workers_use_as_many_cores_as_they_have_threads(engine):
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


def test_call_is_abandoned_when_it_kills_its_workers(engine):
    with pytest.raises(WorkerDiedError, match="2 Dask workers died during this call"):
        engine.submit(die_always).result(120)
    assert engine.submit(square, 5).result(60) == 25


def test_other_calls_succeed_when_a_call_kills_its_workers(engine):
    outcomes = dict(engine.as_completed(die_or_square, [(number, 4) for number in range(12)]))
    failed = [item for item, outcome in outcomes.items() if outcome.exception()]
    assert failed == [(4, 4)]
    assert isinstance(outcomes[4, 4].exception(), WorkerDiedError)


def test_engine_closes_immediately_while_calls_run_and_wait(cluster):
    """Two calls run and two wait; Dask chooses the order, because it steals work."""

    def interrupted():
        with open_engine(scheduler=cluster.scheduler_address) as engine:
            wait_until(lambda: engine.n_workers == 2, "workers that a test killed to come back")
            threading.Timer(1.0, _thread.interrupt_main).start()
            list(engine.map_in_order(slow_square, [(2, 600)] * 4))

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < 60


def test_open_engine_fails_when_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("meshreel.runtime.engine.dask_cluster.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(InvalidInputError, match="no Dask scheduler answers at 'tcp://127"):
        open_engine(scheduler="tcp://127.0.0.1:9")


def test_error_names_the_extra_when_dask_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[dask\]'"):
        open_engine(scheduler="tcp://127.0.0.1:8786")


def test_calls_fail_when_the_scheduler_stops():
    with (
        local_cluster(1) as cluster,
        open_engine(scheduler=cluster.scheduler_address) as engine,
    ):
        assert engine.submit(square, 2).result(60) == 4
        outcome = engine.submit(slow_square, 2, 600)
        cluster.close()
        with pytest.raises(WorkerDiedError, match="scheduler"):
            outcome.result(120)


@pytest.fixture
def log(monkeypatch, caplog):
    """Log of the watch, which reports soon and often."""
    monkeypatch.setattr("meshreel.runtime.engine.worker_watch.POLL_S", 0.05)
    monkeypatch.setattr("meshreel.runtime.engine.worker_watch.FIRST_WARNING_S", 0.2)
    return caplog


@pytest.fixture(scope="module")
def empty_cluster():
    with local_cluster(0) as made:
        yield made


def test_calls_fail_with_a_reason_without_workers_for_too_long(empty_cluster, log):
    with open_engine(scheduler=empty_cluster.scheduler_address, max_wait_s=1.0) as engine:
        outcomes = [engine.submit(square, number) for number in range(3)]
        for outcome in outcomes:
            with pytest.raises(WorkerDiedError, match="has had no workers for 1 s, and calls were"):
                outcome.result(60)
    waiting = [record.message for record in log.records if "3 calls wait" in record.message]
    assert empty_cluster.scheduler_address in waiting[0]
    assert "Ctrl-C stops; after 1 s they are abandoned" in waiting[0]


def test_new_calls_fail_immediately_after_the_wait_was_abandoned(empty_cluster, log):
    with open_engine(scheduler=empty_cluster.scheduler_address, max_wait_s=1.0) as engine:
        outcomes = dict(engine.as_completed(square, [(number,) for number in range(20)]))
        began = time.monotonic()
        late = engine.submit(square, 2)
        assert isinstance(late.exception(0), WorkerDiedError)
        assert time.monotonic() - began < 1.0
    assert {type(outcome.exception()) for outcome in outcomes.values()} == {WorkerDiedError}


def test_ctrl_c_ends_the_wait_for_workers(empty_cluster, log):
    waiting = []

    def interrupted():
        with open_engine(scheduler=empty_cluster.scheduler_address) as engine:
            waiting.append(engine.submit(square, 2))
            wait_until(lambda: "1 call waits" in log.text, "the message that a call waits")
            raise KeyboardInterrupt

    with time_limit(60, "the engine to close"), pytest.raises(KeyboardInterrupt):
        interrupted()


def test_waiting_calls_run_when_workers_start(log):
    with (
        local_cluster(0) as cluster,
        open_engine(scheduler=cluster.scheduler_address) as engine,
    ):
        assert engine.n_workers == 0
        outcome = engine.submit(square, 3)
        wait_until(lambda: "1 call waits" in log.text, "the message that a call waits")
        cluster.scale(1)
        assert outcome.result(60) == 9
        wait_until(lambda: "has workers again" in log.text, "the message that there are workers")


def test_calls_run_when_workers_start_after_earlier_ones_were_abandoned(log):
    with (
        local_cluster(0) as cluster,
        open_engine(scheduler=cluster.scheduler_address, max_wait_s=0.5) as engine,
    ):
        with pytest.raises(WorkerDiedError):
            engine.submit(square, 3).result(60)
        cluster.scale(1)
        wait_until(lambda: engine.n_workers == 1, "a worker to start")
        assert engine.submit(square, 3).result(60) == 9


@pytest.mark.parametrize("seconds", [0, -1, float("inf"), float("nan")])
def test_max_wait_is_rejected_when_it_is_not_positive_and_finite(seconds):
    with pytest.raises(InvalidInputError, match="max_wait_s must be finite and above 0"):
        open_engine(scheduler="tcp://127.0.0.1:9", max_wait_s=seconds)


def test_max_wait_is_rejected_without_a_scheduler():
    with pytest.raises(InvalidInputError, match="max_wait_s needs a scheduler"):
        open_engine(2, max_wait_s=10)
