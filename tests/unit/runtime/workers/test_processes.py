"""Calls on worker processes: order, limits, errors, and processes that die."""

import multiprocessing
import os
import signal
import time
from functools import partial

import pytest

from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.runtime.threads import n_cores
from meshreel.runtime.workers.executors import ProcessExecutor
from samples.tasks import (
    cores_and_blas_threads,
    die_always,
    die_once_if,
    die_or_square,
    die_within_a_long_reply,
    fail,
    fail_unpicklably,
    ignores_ctrl_c,
    process_id,
    slow_square,
    square,
)


@pytest.fixture(scope="module")
def executor():
    with ProcessExecutor(2) as opened:
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


@pytest.mark.slow
def test_submit_uses_the_requested_number_of_processes(executor):
    processes = {outcome.result(60) for outcome in [executor.submit(process_id) for _ in range(20)]}
    assert 1 <= len(processes) <= 2
    assert os.getpid() not in processes


@pytest.mark.slow
def test_submit_raises_the_error_of_the_call_with_its_location(executor):
    with pytest.raises(ValueError, match="no such thing") as caught:
        executor.submit(fail, "no such thing").result(60)
    assert "tasks.py" in str(caught.value.__cause__)


def test_submit_raises_the_text_of_an_error_that_cannot_be_pickled(executor):
    with pytest.raises(RuntimeError, match="UnpicklableError: one and two"):
        executor.submit(fail_unpicklably).result(60)


def test_submit_raises_when_the_call_cannot_be_pickled(executor):
    with pytest.raises((AttributeError, TypeError), match="pickle"):
        executor.submit(lambda: 1).result(60)
    assert executor.submit(square, 3).result(60) == 9


@pytest.mark.slow
def test_calls_are_repeated_when_their_workers_are_killed(executor, tmp_path):
    call = partial(die_once_if, folder=str(tmp_path), deadly={3, 4, 8})
    outcomes = [executor.submit(call, number) for number in range(12)]
    assert [outcome.result(60) for outcome in outcomes] == [n * n for n in range(12)]
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
def test_call_is_abandoned_when_it_killed_two_workers(executor):
    with pytest.raises(WorkerDiedError, match="2 worker processes died during this call"):
        executor.submit(die_always).result(60)
    assert executor.submit(square, 5).result(60) == 25


@pytest.mark.slow
def test_other_calls_succeed_when_a_call_kills_its_workers(executor):
    outcomes = [executor.submit(die_or_square, number, 4) for number in range(30)]
    assert [number for number in range(30) if outcomes[number].exception(60)] == [4]
    assert isinstance(outcomes[4].exception(), WorkerDiedError)


@pytest.mark.slow
def test_call_is_abandoned_when_the_worker_dies_during_its_reply(executor):
    with pytest.raises(WorkerDiedError):
        executor.submit(die_within_a_long_reply).result(60)


@pytest.mark.slow
def test_worker_that_died_idle_is_replaced():
    with ProcessExecutor(1) as executor:
        process = executor.submit(process_id).result(60)
        [child] = [child for child in multiprocessing.active_children() if child.pid == process]
        child.kill()
        child.join(10)
        assert executor.submit(square, 6).result(60) == 36


def test_workers_share_the_cores_and_have_one_blas_thread_each(executor):
    cores, blas = executor.submit(cores_and_blas_threads).result(60)
    assert cores == max(1, n_cores() // 2)
    assert set(blas) == {1}


@pytest.mark.slow
def test_worker_has_all_cores_when_it_is_the_only_one():
    with ProcessExecutor(1) as executor:
        assert executor.submit(cores_and_blas_threads).result(60)[0] == n_cores()


@pytest.mark.slow
def test_ctrl_c_does_not_end_a_worker(executor):
    survivor = executor.submit(ignores_ctrl_c, 0.1).result(60)
    assert survivor in {child.pid for child in multiprocessing.active_children()}


@pytest.mark.slow
def test_processes_end_when_the_executor_is_closed():
    with ProcessExecutor(1) as executor:
        process = executor.submit(process_id).result(60)
    assert has_ended(process)


@pytest.mark.slow
def test_process_is_killed_when_it_does_not_exit():
    with ProcessExecutor(1) as executor:
        process = executor.submit(process_id).result(60)
        os.kill(process, signal.SIGSTOP)
    assert has_ended(process)


@pytest.mark.slow
def test_running_calls_finish_when_the_executor_is_closed():
    with ProcessExecutor(1) as executor:
        outcomes = [executor.submit(slow_square, number, 0.1) for number in range(3)]
    assert [outcome.result(0) for outcome in outcomes] == [0, 1, 4]


def interrupted_executor(results):
    with ProcessExecutor(1) as executor:
        process = executor.submit(process_id).result(60)
        outcomes = [executor.submit(slow_square, 1, 600) for _ in range(3)]
        time.sleep(0.1)
        try:
            raise KeyboardInterrupt
        finally:
            results.extend([process, outcomes])


@pytest.mark.slow
def test_running_calls_stop_when_an_exception_leaves_the_executor():
    results = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_executor(results)
    process, outcomes = results
    assert has_ended(process)
    assert all(outcome.done() for outcome in outcomes)
    assert isinstance(outcomes[0].exception(), WorkerDiedError)
    assert all(outcome.cancelled() for outcome in outcomes[1:])


@pytest.mark.parametrize("n_workers", [0, -1])
def test_executor_is_rejected_without_workers(n_workers):
    with pytest.raises(InvalidInputError, match="workers must be 1 or more"):
        ProcessExecutor(n_workers)
