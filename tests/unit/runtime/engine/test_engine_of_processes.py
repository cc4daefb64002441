"""Calls on worker processes: order, limits, errors, and processes that die."""

import itertools
import multiprocessing
import os
import signal
import time
from functools import partial

import pytest

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.runtime.engine.engine import Engine, open_engine
from meshreel.runtime.engine.processes import ProcessWorkers
from meshreel.runtime.threads import n_cores
from samples.tasks import (
    cores_and_blas_threads,
    die_always,
    die_once,
    die_once_if,
    die_or_square,
    die_within_a_long_reply,
    fail,
    fail_unpicklably,
    ignores_ctrl_c,
    process_id,
    slow_square,
    square,
    square_after,
)


@pytest.fixture(scope="module")
def engine():
    with open_engine(2) as opened:
        yield opened


def has_ended(process):
    """Return whether the process ends within five seconds."""
    for _ in range(100):
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def test_submit_returns_the_result_of_the_call(engine):
    assert engine.submit(square, 7).result(60) == 49


def test_submit_uses_the_requested_number_of_processes(engine):
    processes = {outcome.result(60) for outcome in [engine.submit(process_id) for _ in range(20)]}
    assert 1 <= len(processes) <= 2
    assert os.getpid() not in processes


def test_submit_raises_the_error_of_the_call_with_its_location(engine):
    with pytest.raises(ValueError, match="no such thing") as caught:
        engine.submit(fail, "no such thing").result(60)
    assert "tasks.py" in caught.value.__notes__[0]


def test_submit_raises_the_text_of_an_error_that_cannot_be_pickled(engine):
    with pytest.raises(RuntimeError, match="UnpicklableError: one and two"):
        engine.submit(fail_unpicklably).result(60)


def test_submit_raises_when_the_call_cannot_be_pickled(engine):
    with pytest.raises((AttributeError, TypeError), match="pickle"):
        engine.submit(lambda: 1).result(60)
    assert engine.submit(square, 3).result(60) == 9


def test_map_in_order_keeps_the_order_when_later_calls_end_first(engine):
    items = [(number, 0.2 if number == 0 else 0.0) for number in range(12)]
    assert list(engine.map_in_order(slow_square, items)) == [n * n for n in range(12)]


def test_map_in_order_accepts_bound_arguments(engine):
    assert list(engine.map_in_order(partial(pow, 2), [(3,), (4,)])) == [8, 16]


@pytest.mark.parametrize("in_flight", [1, 3])
def test_map_in_order_reads_at_most_in_flight_items_ahead(engine, in_flight):
    read = []
    items = ((number,) for number in itertools.count() if not read.append(number))
    results = engine.map_in_order(square, items, in_flight=in_flight)
    for n_done in range(1, 10):
        next(results)
        assert len(read) <= n_done - 1 + in_flight
    results.close()


def test_map_in_order_reads_two_items_per_worker_by_default(engine):
    read = []
    items = ((number,) for number in itertools.count() if not read.append(number))
    results = engine.map_in_order(square, items)
    assert next(results) == 0
    assert len(read) == 4
    results.close()


def test_map_in_order_is_empty_without_items(engine):
    assert list(engine.map_in_order(square, [])) == []


def test_map_in_order_raises_in_order(engine):
    results = engine.map_in_order(divmod, [(7, 2), (7, 0), (7, 3)])
    assert next(results) == (3, 1)
    with pytest.raises(ZeroDivisionError):
        next(results)
    assert list(results) == []


@pytest.mark.parametrize("in_flight", [0, -1])
def test_map_in_order_rejects_in_flight_below_one(engine, in_flight):
    with pytest.raises(InvalidInputError, match="in_flight must be 1 or more"):
        next(engine.map_in_order(square, [(1,)], in_flight=in_flight))


@pytest.mark.slow
def test_map_in_order_recovers_when_workers_are_killed_in_the_middle(engine, tmp_path):
    call = partial(die_once_if, folder=str(tmp_path), deadly={3, 4, 8})
    results = engine.map_in_order(call, [(number,) for number in range(12)])
    assert list(results) == [n * n for n in range(12)]
    assert len(list(tmp_path.iterdir())) == 3


def test_as_completed_pairs_items_with_their_outcomes(engine):
    results = {
        item: outcome.exception() or outcome.result()
        for item, outcome in engine.as_completed(divmod, [(7, 2), (7, 0), (9, 4)])
    }
    assert results[7, 2] == (3, 1)
    assert results[9, 4] == (2, 1)
    assert isinstance(results[7, 0], ZeroDivisionError)


def test_as_completed_yields_in_order_of_completion(engine, tmp_path):
    existing, mark = tmp_path, tmp_path / "the other call is complete"
    order = []
    for (number, _), _ in engine.as_completed(square_after, [(1, mark), (2, existing)]):
        order.append(number)
        mark.touch()
    assert order == [2, 1]


def test_call_is_abandoned_when_it_killed_two_workers(engine):
    with pytest.raises(WorkerDiedError, match=r"2 worker processes died during this call.*SIGKILL"):
        engine.submit(die_always).result(60)
    assert engine.submit(square, 5).result(60) == 25


@pytest.mark.slow
def test_other_calls_succeed_when_a_call_kills_its_workers(engine):
    items = [(number, 4) for number in range(30)]
    outcomes = dict(engine.as_completed(die_or_square, items))
    failed = [item for item, outcome in outcomes.items() if outcome.exception()]
    assert failed == [(4, 4)]
    assert isinstance(outcomes[4, 4].exception(), WorkerDiedError)


@pytest.mark.slow
def test_call_is_abandoned_when_the_worker_dies_during_its_reply(engine):
    with pytest.raises(WorkerDiedError):
        engine.submit(die_within_a_long_reply).result(60)


@pytest.mark.slow
def test_worker_that_died_idle_is_replaced(tmp_path):
    with open_engine(1) as engine:
        process = engine.submit(process_id).result(60)
        [child] = [child for child in multiprocessing.active_children() if child.pid == process]
        child.kill()
        child.join(10)
        assert engine.submit(die_once, 6, str(tmp_path)).result(60) == 36


def test_workers_share_the_cores_and_have_one_blas_thread_each(engine):
    cores, blas = engine.submit(cores_and_blas_threads).result(60)
    assert cores == max(1, n_cores() // engine.n_workers)
    assert set(blas) == {1}


@pytest.mark.slow
def test_worker_has_all_cores_when_it_is_the_only_one():
    with open_engine(1) as engine:
        assert engine.submit(cores_and_blas_threads).result(60)[0] == n_cores()


def test_ctrl_c_does_not_end_a_worker(engine):
    survivor = engine.submit(ignores_ctrl_c, 0.1).result(60)
    assert survivor in {child.pid for child in multiprocessing.active_children()}


@pytest.mark.slow
def test_processes_end_when_the_engine_is_closed():
    with open_engine(1) as engine:
        process = engine.submit(process_id).result(60)
    assert has_ended(process)


@pytest.mark.slow
def test_process_is_killed_when_it_does_not_exit(monkeypatch):
    monkeypatch.setattr("meshreel.runtime.engine.processes.EXIT_TIMEOUT_S", 0.2)
    with open_engine(1) as engine:
        process = engine.submit(process_id).result(60)
        os.kill(process, signal.SIGSTOP)
    assert has_ended(process)


def test_running_calls_finish_when_the_engine_is_closed():
    with open_engine(1) as engine:
        outcomes = [engine.submit(slow_square, number, 0.1) for number in range(3)]
    assert [outcome.result(0) for outcome in outcomes] == [0, 1, 4]


def interrupted_engine(results):
    with open_engine(1) as engine:
        process = engine.submit(process_id).result(60)
        outcomes = [engine.submit(slow_square, 1, 600) for _ in range(3)]
        time.sleep(0.1)
        try:
            raise KeyboardInterrupt
        finally:
            results.extend([process, outcomes])


def test_running_calls_stop_when_an_exception_leaves_the_engine():
    results = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_engine(results)
    process, outcomes = results
    assert has_ended(process)
    assert all(outcome.done() for outcome in outcomes)
    assert isinstance(outcomes[0].exception(), WorkerDiedError)
    assert all(outcome.cancelled() for outcome in outcomes[1:])


@pytest.mark.parametrize("n_workers", [0, -1])
def test_engine_is_rejected_without_workers(n_workers):
    with pytest.raises(InvalidInputError, match="workers must be 1 or more"):
        open_engine(n_workers)


def test_engine_is_rejected_with_workers_and_a_scheduler():
    with pytest.raises(InvalidInputError, match="cannot be combined"):
        open_engine(2, scheduler="tcp://127.0.0.1:8786")


def test_engine_has_one_worker_per_core_by_default():
    with open_engine() as engine:
        assert engine.n_workers == n_cores()


@pytest.mark.slow
def test_engine_accepts_any_workers():
    engine = Engine(ProcessWorkers(1))
    assert list(engine.map_in_order(square, [(2,)])) == [4]
    engine.close()
