"""Log messages while calls wait for workers, and the end of the wait."""

import pytest

from meshreel.runtime.engine import worker_watch
from meshreel.runtime.engine.worker_watch import WorkerCount, WorkerWatch

ADDRESS = "tcp://10.0.0.5:8786"


class Cluster:
    """A cluster with a state set by tests, and its watch."""

    def __init__(self, max_wait_s=3600.0):
        self.count, self.n_calls, self.abandoned = WorkerCount(0), 4, []
        self.watch = WorkerWatch(
            ADDRESS, lambda: self.count, lambda: self.n_calls, self.abandoned.append, max_wait_s
        )

    def pass_time(self, start, stop):
        for second in range(start, stop):
            self.watch.poll(float(second))


@pytest.fixture
def messages(caplog):
    return lambda: [record.message for record in caplog.records]


def test_short_absence_of_workers_is_not_logged(messages):
    cluster = Cluster()
    cluster.pass_time(0, 15)
    cluster.count = WorkerCount(2)
    cluster.pass_time(15, 100)
    assert messages() == []


def test_first_message_states_duration_waiting_calls_and_remedy(messages):
    Cluster().pass_time(100, 116)
    [message] = messages()
    assert message == (
        f"the Dask cluster at {ADDRESS} has had no workers for 15 s; 4 calls wait. "
        f"'dask worker {ADDRESS}' starts a worker. Ctrl-C stops; after 60 minutes they are "
        "abandoned"
    )


def test_message_interval_grows_up_to_five_minutes(messages):
    Cluster().pass_time(0, 1300)
    times = [text.partition(" for ")[2].partition(";")[0] for text in messages()]
    assert times == ["15 s", "30 s", "60 s", "2 minutes", "4 minutes", "8 minutes",
                     "13 minutes", "18 minutes"]  # fmt: skip


def test_nothing_is_logged_when_no_call_waits(messages):
    cluster = Cluster()
    cluster.n_calls = 0
    cluster.pass_time(0, 5000)
    assert messages() == []
    assert cluster.abandoned == []


def test_wait_restarts_after_workers_were_available(messages):
    cluster = Cluster(max_wait_s=100.0)
    cluster.pass_time(0, 90)
    cluster.count = WorkerCount(1)
    cluster.pass_time(90, 91)
    cluster.count = WorkerCount(0)
    cluster.pass_time(91, 180)
    assert f"the Dask cluster at {ADDRESS} has workers again" in messages()
    assert cluster.abandoned == []


def test_calls_are_abandoned_once_after_the_maximum_wait():
    cluster = Cluster(max_wait_s=60.0)
    cluster.pass_time(0, 60)
    assert cluster.abandoned == []
    cluster.pass_time(60, 70)
    [reason] = cluster.abandoned
    assert reason.startswith(
        f"the Dask cluster at {ADDRESS} has had no workers for 60 s, and calls"
    )


def test_new_calls_are_rejected_until_workers_are_available():
    cluster = Cluster(max_wait_s=60.0)
    cluster.pass_time(0, 61)
    cluster.n_calls = 0
    cluster.pass_time(61, 100)
    assert cluster.watch.refusal() == cluster.abandoned[0]
    cluster.count = WorkerCount(1)
    assert cluster.watch.refusal() is None


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (WorkerCount(0, n_paused=2), "no workers but 2 paused (their memory is nearly full)"),
        (WorkerCount(0, is_reachable=False), "has not answered for 15 s"),
    ],
)  # fmt: skip
def test_message_states_other_reasons_than_missing_workers(messages, count, words):
    cluster = Cluster()
    cluster.count = count
    cluster.pass_time(0, 16)
    assert words in messages()[0]


def test_watch_polls_in_its_thread_until_closed(monkeypatch):
    monkeypatch.setattr(worker_watch, "POLL_S", 0.01)
    cluster = Cluster(max_wait_s=0.05)
    cluster.watch.start()
    cluster.watch._thread.join(0.5)
    cluster.watch.close()
    cluster.watch._thread.join(10)
    assert not cluster.watch._thread.is_alive()
    assert cluster.abandoned


def test_workers_are_reported_also_if_all_calls_have_finished(messages):
    cluster = Cluster()
    cluster.pass_time(0, 90)
    cluster.n_calls, cluster.count = 0, WorkerCount(1)
    cluster.pass_time(90, 91)
    assert f"the Dask cluster at {ADDRESS} has workers again" in messages()
