import os

import numpy as np

from meshreel.studies import timing
from meshreel.studies.timing import (
    cpu_model,
    machine_facts,
    machine_line,
    machines_text,
)


def test_short_work_is_timed_repeatedly_on_request():
    value, seconds = timing.timed(lambda: 5, 3)
    assert value == 5
    assert seconds.shape == (3, 2)


def test_long_work_is_timed_once(monkeypatch):
    monkeypatch.setattr(timing, "REPEAT_BELOW_S", 0.0)
    assert len(timing.timed(lambda: 5, 3)[1]) == 1


def test_facts_are_those_of_this_machine(monkeypatch):
    assert machine_facts()["cores"] == os.cpu_count()
    assert f", {os.cpu_count()} cores, " in machine_line(machine_facts())
    monkeypatch.setattr("os.cpu_count", lambda: None)
    assert machine_facts()["cores"] == 1


def test_each_machine_is_named_once():
    one, other = machine_facts(), {**machine_facts(), "cpu": "another"}
    text = machines_text([{"machine": facts} for facts in (one, other, one)])
    assert text.count(machine_line(one)) == text.count(machine_line(other)) == 1


def test_architecture_replaces_an_unknown_processor_name(monkeypatch):
    monkeypatch.setattr("pathlib.Path.read_text", lambda path: "flags: fast")
    monkeypatch.setattr("platform.processor", lambda: "")
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    assert cpu_model() == "riscv64"
    monkeypatch.setattr("pathlib.Path.read_text", lambda path: "x: 1\nmodel name\t: A Chip\n")
    assert cpu_model() == "A Chip"


def test_seconds_are_medians_on_both_clocks():
    runs = np.array([[3.0, 1.0], [1.0, 2.0], [2.0, 6.0]])
    seconds = timing.seconds_of(runs, runs[:1])
    assert (seconds["encode"], seconds["encode_processor"]) == (2.0, 2.0)
    assert (seconds["decode"], seconds["decode_runs"]) == (3.0, [3.0])
