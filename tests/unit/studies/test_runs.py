import json
import os
import time
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents import Table
from meshreel.runtime.threads import n_cores
from meshreel.studies import timing
from meshreel.studies.runs import (
    Outcome,
    Run,
    Store,
    file_name,
    finite,
    result_of,
    run_all,
    sequence_identity,
)
from meshreel.studies.study import checked_names, claim_folder, to_markdown, unique_names
from meshreel.studies.timing import cpu_model, machine_facts, machine_line, machines_text
from samples.meshes import waving_grid


def test_identity_depends_on_every_position():
    sequence = waving_grid()
    vertices = sequence.vertices.copy()
    vertices[3, 5, 1] += 1e-3
    other = MeshSequence(vertices, sequence.faces, sequence.fps, sequence.name)
    assert sequence_identity(other)["sha256"] != sequence_identity(sequence)["sha256"]
    assert sequence_identity(sequence) == sequence_identity(waving_grid())


def test_sequences_of_one_name_do_not_share_a_folder(tmp_path):
    sequence = waving_grid()
    other = MeshSequence(sequence.vertices * 2, sequence.faces, sequence.fps, sequence.name)
    stores = [Store.for_sequence(tmp_path, each) for each in (sequence, other)]
    assert stores[0].folder != stores[1].folder


def test_file_names_of_sequences_with_one_name_are_numbered():
    names = ["walk", "walk", "a/b", "walk", "a b", "walk-2"]
    found = unique_names([waving_grid(1).replace(name=name) for name in names])
    assert found == ["walk", "walk-2", "a-b", "walk-3", "a-b-2", "walk-2-2"]


def test_non_finite_figures_are_stored_as_valid_json():
    figures = finite({"a": [1.0, float("nan")], "b": {"c": float("inf")}, "d": "x"})
    assert figures == {"a": [1.0, None], "b": {"c": None}, "d": "x"}
    json.dumps(figures, allow_nan=False)


@pytest.fixture
def store(tmp_path):
    return Store.for_sequence(tmp_path, waving_grid())


def stub_run(key, measure=lambda progress: Outcome({"figure": 1}), **others):
    return Run(key, key, {"of": key}, measure, **others)


def raising(error):
    def measure(progress):
        raise error

    return measure


def test_run_in_two_groups_is_executed_once(store):
    calls = []
    runs = {
        key: stub_run(key, lambda _, key=key: Outcome({"key": calls.append(key)})) for key in "ab"
    }
    results = run_all({"first": [runs["a"]], "rest": [runs["b"], runs["a"]]}, store)
    assert calls == ["a", "b"]
    assert results["rest"][1] == results["first"][0]


def test_progress_counts_runs_and_names_stages(store):
    reported = []
    run = stub_run("a", lambda progress: Outcome({"figure": progress("encoding", 0.5)}))

    def listen(stage: str, share: Any) -> None:
        reported.append((stage, share.done))

    run_all({"all": [run, run]}, store, listen)
    assert reported == [("a", 0), ("a, encoding", 0), ("a", 1)]


def test_error_of_the_library_is_stored_as_a_refusal(store):
    run = stub_run("a", raising(InvalidInputError("too large")), facts={"codec": "x"})
    result = result_of(run, store)
    assert (result["codec"], result["refused"]) == ("x", "too large")
    assert result_of(stub_run("a"), store) == result


@pytest.mark.parametrize("error", [RuntimeError("odd"), MemoryError()])
@pytest.mark.parametrize("is_foreign", [True, False])
def test_other_errors_are_refusals_only_for_foreign_packages(store, error, is_foreign):
    run = stub_run("a", raising(error), is_foreign=is_foreign)
    if is_foreign and not isinstance(error, MemoryError):
        assert result_of(run, store)["refused"] == "RuntimeError: odd"
        return
    with pytest.raises(type(error)):
        result_of(run, store)


def test_run_is_repeated_when_a_required_file_is_missing(store):
    run = stub_run("a", lambda _: Outcome({"figure": 1}, {"bin": b"xyz"}), needs=("bin",))
    result_of(run, store)
    assert store.path("a", "bin").read_bytes() == b"xyz"
    store.path("a", "bin").unlink()
    result_of(run, store)
    assert store.path("a", "bin").is_file()


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"identity": {}}', "\udcff"])
def test_damaged_result_is_computed_again(store, text):
    first = result_of(stub_run("a"), store)
    store.path("a", "json").write_text(text, errors="surrogateescape")
    assert store.find(stub_run("a")) is None
    assert result_of(stub_run("a"), store) == first


def test_result_of_another_version_is_computed_again(store, monkeypatch):
    result_of(stub_run("a"), store)
    monkeypatch.setattr("meshreel.studies.runs.__version__", "99")
    assert store.find(stub_run("a")) is None


KNOWN = ("pca", "v2v", "gft")
PROGRAM, MARKER = "meshreel paper", "meshreel-paper.json"


def test_names_are_returned_in_the_order_of_known_names():
    assert checked_names(["gft", "pca", "gft"], KNOWN, "method") == ("pca", "gft")


@pytest.mark.parametrize(
    ("names", "problem"),
    [(["pcaqp"], "method 'pcaqp' is unknown"), ([], "name at least one method")],
)
def test_error_for_an_unknown_or_missing_name_lists_the_names(names, problem):
    with pytest.raises(InvalidInputError, match=f"{problem}; choose from pca, v2v, gft"):
        checked_names(names, KNOWN, "method")


def test_new_folder_is_created_and_marked(tmp_path):
    claim_folder(tmp_path / "a" / "b", PROGRAM, "meshreel paper")
    facts = json.loads((tmp_path / "a" / "b" / MARKER).read_text())
    assert facts["command"] == "meshreel paper"


def test_marked_folder_is_reused(tmp_path):
    claim_folder(tmp_path, PROGRAM, "first")
    (tmp_path / "report.md").write_text("old")
    claim_folder(tmp_path, PROGRAM, "second")
    assert json.loads((tmp_path / MARKER).read_text())["command"] == "second"


@pytest.mark.parametrize("marker", [None, "", "[]", '{"made_by": "another"}'])
def test_folder_with_foreign_files_is_rejected_and_unchanged(tmp_path, marker):
    (tmp_path / "thesis.txt").write_text("mine")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match=str(tmp_path)):
        claim_folder(tmp_path, PROGRAM, "meshreel paper x.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_error_names_a_file_given_as_folder(tmp_path):
    (tmp_path / "report").write_text("")
    with pytest.raises(InvalidInputError, match="report is a file; name a folder"):
        claim_folder(tmp_path / "report", PROGRAM, "meshreel paper")


@pytest.mark.parametrize(
    ("name", "expected"), [("samba", "samba"), ("a/../b c", "a-..-b-c"), ("../", "sequence")]
)
def test_special_characters_of_names_are_replaced_in_file_names(name, expected):
    assert file_name(name) == expected


def test_bars_in_tables_are_escaped(tmp_path):
    table = Table("T", ("a", "b|c"), (("x", "1 < 2"),))
    markdown = to_markdown([table], tmp_path)
    assert "| a | b\\|c |\n| --- | ---: |\n| x | 1 < 2 |" in markdown


def test_short_work_is_timed_repeatedly_on_request():
    value, seconds = timing.timed(lambda: 5, 3)
    assert value == 5
    assert seconds.shape == (3, 2)


def test_work_that_waits_takes_no_processor_time():
    _, seconds = timing.timed_once(lambda: time.sleep(0.1))
    assert 0 <= seconds.processor < 0.1 <= seconds.wall


def test_long_work_is_timed_once():
    assert len(timing.timed(lambda: 5, 3, repeat_below_s=0.0)[1]) == 1


def test_one_thread_is_used_by_blas_and_by_our_code_and_others_again_afterwards():
    def n_threads():
        return {*(each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas")}

    before = n_threads(), n_cores()
    with timing.one_thread():
        assert (n_threads(), n_cores()) == ({1}, 1)
    assert (n_threads(), n_cores()) == before


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
    assert (seconds["decode"], seconds["decode_runs"]) == (3.0, [1.0])
