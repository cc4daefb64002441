"""Calls on a Dask cluster of two workers on this machine, each a process that may die."""

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
    # What Dask itself leaves behind where workers and schedulers are killed.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module")
def cluster():
    with local_cluster(2) as made:
        yield made


@pytest.fixture
def engine(cluster):
    with open_engine(scheduler=cluster.scheduler_address) as opened:
        wait_until(lambda: opened.n_workers == 2, "the worker that a test killed to come back")
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
    with pytest.raises(WorkerDiedError, match="2 Dask workers died during this call"):
        engine.submit(die_always).result(120)
    assert engine.submit(square, 5).result(60) == 25


def test_others_are_not_blamed_when_a_call_kills_its_workers(engine):
    outcomes = dict(engine.as_completed(die_or_square, [(number, 4) for number in range(12)]))
    failed = [item for item, outcome in outcomes.items() if outcome.exception()]
    assert failed == [(4, 4)]
    assert isinstance(outcomes[4, 4].exception(), WorkerDiedError)


def test_engine_is_left_at_once_when_calls_still_run_and_wait(cluster):
    """Two calls run and two wait; which comes first is Dask's to choose, for it steals work."""

    def interrupted():
        with open_engine(scheduler=cluster.scheduler_address) as engine:
            wait_until(lambda: engine.n_workers == 2, "workers that a test killed to come back")
            threading.Timer(1.0, _thread.interrupt_main).start()
            list(engine.map_in_order(slow_square, [(2, 600)] * 4))

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - began < 60


def test_engine_is_refused_when_no_scheduler_answers(monkeypatch):
    monkeypatch.setattr("meshreel.runtime.engine.dask_cluster.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(InvalidInputError, match="no Dask scheduler answers at 'tcp://127"):
        open_engine(scheduler="tcp://127.0.0.1:9")


def test_engine_is_refused_with_the_remedy_when_dask_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[dask\]'"):
        open_engine(scheduler="tcp://127.0.0.1:8786")


def test_calls_fail_instead_of_hanging_when_the_scheduler_goes():
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
def words(monkeypatch, caplog):
    """What is logged while calls wait, which is soon and often here."""
    monkeypatch.setattr("meshreel.runtime.engine.worker_watch.POLL_S", 0.05)
    monkeypatch.setattr("meshreel.runtime.engine.worker_watch.FIRST_WARNING_S", 0.2)
    return caplog


@pytest.fixture(scope="module")
def empty_cluster():
    with local_cluster(0) as made:
        yield made


def test_calls_fail_in_words_when_there_are_no_workers_for_too_long(empty_cluster, words):
    with open_engine(scheduler=empty_cluster.scheduler_address, max_wait_s=1.0) as engine:
        outcomes = [engine.submit(square, number) for number in range(3)]
        for outcome in outcomes:
            with pytest.raises(WorkerDiedError, match="has had no workers for 1 s, and calls were"):
                outcome.result(60)
    waiting = [record.message for record in words.records if "3 calls wait" in record.message]
    assert empty_cluster.scheduler_address in waiting[0]
    assert "Ctrl-C stops; after 1 s they are abandoned" in waiting[0]


def test_further_calls_fail_at_once_when_waiting_was_given_up(empty_cluster, words):
    with open_engine(scheduler=empty_cluster.scheduler_address, max_wait_s=1.0) as engine:
        outcomes = dict(engine.as_completed(square, [(number,) for number in range(20)]))
        began = time.monotonic()
        late = engine.submit(square, 2)
        assert isinstance(late.exception(0), WorkerDiedError)
        assert time.monotonic() - began < 1.0
    assert {type(outcome.exception()) for outcome in outcomes.values()} == {WorkerDiedError}


def test_waiting_ends_when_the_engine_is_left_by_ctrl_c(empty_cluster, words):
    waiting = []

    def interrupted():
        with open_engine(scheduler=empty_cluster.scheduler_address) as engine:
            waiting.append(engine.submit(square, 2))
            wait_until(lambda: "1 call waits" in words.text, "the word that a call waits")
            raise KeyboardInterrupt

    with time_limit(60, "the engine to close"), pytest.raises(KeyboardInterrupt):
        interrupted()


def test_calls_are_done_when_workers_come_while_they_wait(words):
    with (
        local_cluster(0) as cluster,
        open_engine(scheduler=cluster.scheduler_address) as engine,
    ):
        assert engine.n_workers == 0
        outcome = engine.submit(square, 3)
        wait_until(lambda: "1 call waits" in words.text, "the word that a call waits")
        cluster.scale(1)
        assert outcome.result(60) == 9
        wait_until(lambda: "has workers again" in words.text, "the word that there are workers")


def test_calls_are_done_again_when_workers_come_after_they_were_given_up(words):
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
def test_engine_is_refused_when_the_longest_wait_is_no_time(seconds):
    with pytest.raises(InvalidInputError, match="max_wait_s must be finite and above 0"):
        open_engine(scheduler="tcp://127.0.0.1:9", max_wait_s=seconds)


def test_engine_is_refused_when_a_longest_wait_is_given_without_a_scheduler():
    with pytest.raises(InvalidInputError, match="max_wait_s needs a scheduler"):
        open_engine(2, max_wait_s=10)
