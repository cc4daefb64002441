"""Profiles: seconds and calls by stage and thread."""

import threading
import time

import pytest

from meshreel.runtime.profiling import profiled, stage, staged
from meshreel.runtime.threads import in_background, in_threads

PAUSE_S = 0.02


def pause():
    time.sleep(PAUSE_S)


def stages_of(profile):
    """Return the number of calls by path and by whether another thread made them."""
    return {(one.path, one.in_other_thread): one.n_calls for one in profile.stages}


def test_seconds_exclude_time_outside_of_the_stage():
    with profiled() as profile:
        pause()
        with stage("work"):
            pause()
            pause()
        pause()
    (work,) = profile.stages
    assert 2 * PAUSE_S <= work.seconds <= profile.wall_s - 2 * PAUSE_S
    assert profile.unnamed_s == pytest.approx(profile.wall_s - work.seconds)


def test_calls_and_seconds_of_a_repeated_stage_add_up():
    with profiled() as profile:
        for _ in range(3):
            with stage("work"):
                pause()
    assert stages_of(profile) == {(("work",), False): 3}
    assert profile.stages[0].seconds >= 3 * PAUSE_S


def test_nested_stages_are_parts():
    with profiled() as profile:
        with stage("whole"):
            with stage("part"):
                pause()
            pause()
        with stage("part"):
            pass
    whole, part, alone = profile.stages
    assert (whole.path, part.path, alone.path) == (("whole",), ("whole", "part"), ("part",))
    assert whole.seconds >= part.seconds + PAUSE_S >= 2 * PAUSE_S
    assert profile.unnamed_s == pytest.approx(profile.wall_s - whole.seconds - alone.seconds)


def test_parts_follow_their_stage_when_it_is_repeated():
    with profiled() as profile:
        for part in ("early", "late"):
            with stage("whole"), stage(part):
                pass
            with stage("other"):
                pass
    assert [one.path for one in profile.stages] == [
        ("whole",), ("whole", "early"), ("whole", "late"), ("other",),
    ]  # fmt: skip


def test_recursive_stage_is_counted_once():
    @staged("work")
    def countdown(n):
        return countdown(n - 1) if n else "done"

    with profiled() as profile:
        assert countdown(3) == "done"
    assert stages_of(profile) == {(("work",), False): 1}


def test_staged_function_keeps_its_name_arguments_and_result():
    @staged("sum")
    def add(a, *, b):
        """A sum."""
        return a + b

    assert add(1, b=2) == 3
    assert (add.__name__, add.__doc__) == ("add", "A sum.")
    with profiled() as profile:
        assert add(3, b=4) == 7
    assert stages_of(profile) == {(("sum",), False): 1}


def test_seconds_are_kept_when_a_stage_fails():
    @staged("whole")
    def fail():
        with stage("part"):
            pause()
            raise LookupError

    with profiled() as profile:
        with pytest.raises(LookupError):
            fail()
        with stage("after"):
            pass
    assert [one.path for one in profile.stages] == [("whole",), ("whole", "part"), ("after",)]
    assert min(one.seconds for one in profile.stages[:2]) >= PAUSE_S


def test_stages_outside_of_a_profile_are_not_recorded():
    with profiled() as profile:
        pass
    with stage("after"):
        pass
    assert profile.stages == []


def test_clock_stops_when_the_profile_ends():
    with profiled() as profile:
        pause()
    ended_s = profile.wall_s
    pause()
    assert profile.wall_s == ended_s >= PAUSE_S


def test_background_work_is_recorded_separately():
    def work():
        with stage("work"):
            pause()

    with profiled() as profile, stage("whole"):
        future = in_background(work)
        work()
        future.result()
    assert stages_of(profile) == {
        (("whole",), False): 1,
        (("whole", "work"), False): 1,
        (("whole", "work"), True): 1,
    }
    assert profile.unnamed_s >= 0


def test_calls_of_many_threads_are_all_counted():
    def work(_):
        for _ in range(50):
            with stage("work"):
                pass

    with profiled() as profile:
        in_threads(work, range(40))
    assert stages_of(profile) == {(("work",), True): 2000}


def test_profiles_of_two_threads_are_separate():
    profiles = {}

    def listen(name):
        with profiled() as profiles[name], stage(name):
            pause()

    threads = [threading.Thread(target=listen, args=(name,)) for name in ("one", "other")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for name, profile in profiles.items():
        assert stages_of(profile) == {((name,), False): 1}
