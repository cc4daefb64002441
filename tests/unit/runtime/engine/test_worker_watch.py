"""What is said while calls wait for a cluster without workers, and when the wait ends."""

import pytest

from meshreel.runtime.engine import worker_watch
from meshreel.runtime.engine.worker_watch import WorkerCount, WorkerWatch

ADDRESS = "tcp://10.0.0.5:8786"


class Cluster:
    """A cluster whose state a test sets, and the watch over it."""

    def __init__(self, max_wait_s=3600.0):
        self.count, self.n_calls, self.given_up = WorkerCount(0), 4, []
        self.watch = WorkerWatch(
            ADDRESS, lambda: self.count, lambda: self.n_calls, self.given_up.append, max_wait_s
        )

    def pass_time(self, start, stop):
        for second in range(start, stop):
            self.watch.poll(float(second))


@pytest.fixture
def said(caplog):
    return lambda: [record.message for record in caplog.records]


def test_nothing_is_said_when_workers_are_away_for_a_moment(said):
    cluster = Cluster()
    cluster.pass_time(0, 15)
    cluster.count = WorkerCount(2)
    cluster.pass_time(15, 100)
    assert said() == []


def test_first_word_says_how_long_what_waits_and_what_to_do(said):
    Cluster().pass_time(100, 116)
    [word] = said()
    assert word == (
        f"the Dask cluster at {ADDRESS} has had no workers for 15 s; 4 calls wait. "
        f"'dask worker {ADDRESS}' starts a worker. Ctrl-C stops; after 60 minutes they are "
        "abandoned"
    )


def test_words_come_less_and_less_often_but_at_least_every_five_minutes(said):
    Cluster().pass_time(0, 1300)
    times = [word.partition(" for ")[2].partition(";")[0] for word in said()]
    assert times == ["15 s", "30 s", "60 s", "2 minutes", "4 minutes", "8 minutes",
                     "13 minutes", "18 minutes"]  # fmt: skip


def test_nothing_is_said_when_no_call_waits(said):
    cluster = Cluster()
    cluster.n_calls = 0
    cluster.pass_time(0, 5000)
    assert said() == []
    assert cluster.given_up == []


def test_wait_begins_anew_when_workers_were_there_meanwhile(said):
    cluster = Cluster(max_wait_s=100.0)
    cluster.pass_time(0, 90)
    cluster.count = WorkerCount(1)
    cluster.pass_time(90, 91)
    cluster.count = WorkerCount(0)
    cluster.pass_time(91, 180)
    assert f"the Dask cluster at {ADDRESS} has workers again" in said()
    assert cluster.given_up == []


def test_calls_are_given_up_once_when_the_longest_wait_is_over():
    cluster = Cluster(max_wait_s=60.0)
    cluster.pass_time(0, 60)
    assert cluster.given_up == []
    cluster.pass_time(60, 70)
    [reason] = cluster.given_up
    assert reason.startswith(
        f"the Dask cluster at {ADDRESS} has had no workers for 60 s, and calls"
    )


def test_further_calls_are_refused_until_there_are_workers():
    cluster = Cluster(max_wait_s=60.0)
    cluster.pass_time(0, 61)
    cluster.n_calls = 0
    cluster.pass_time(61, 100)
    assert cluster.watch.refusal() == cluster.given_up[0]
    cluster.count = WorkerCount(1)
    assert cluster.watch.refusal() is None


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (WorkerCount(0, n_paused=2), "no workers but 2 paused (their memory is nearly full)"),
        (WorkerCount(0, is_reachable=False), "has not answered for 15 s"),
    ],
)  # fmt: skip
def test_word_says_what_is_wrong_when_it_is_not_that_workers_are_missing(said, count, words):
    cluster = Cluster()
    cluster.count = count
    cluster.pass_time(0, 16)
    assert words in said()[0]


def test_watch_looks_by_itself_until_it_is_closed(monkeypatch):
    monkeypatch.setattr(worker_watch, "POLL_S", 0.01)
    cluster = Cluster(max_wait_s=0.05)
    cluster.watch.start()
    cluster.watch._thread.join(0.5)
    cluster.watch.close()
    cluster.watch._thread.join(10)
    assert not cluster.watch._thread.is_alive()
    assert cluster.given_up
