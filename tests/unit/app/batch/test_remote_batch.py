"""Batches with remote inputs and outputs."""

import itertools
import json

import fsspec
import pytest

import meshreel
from meshreel.app.batch.discovery import find_inputs
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.manifest import Manifest
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from meshreel.errors import StoreError
from samples.engines import InlineExecutor
from samples.meshes import waving_grid
from samples.stores import put

OPTIONS = EncodeOptions(config_of(quality=60))
IN, OUT = "memory://bucket/in", "memory://bucket/out"


@pytest.fixture
def store():
    """A store in memory with a file, a point cache and a folder of frames."""
    store = fsspec.filesystem("memory")
    store.store.clear()
    put(waving_grid(), f"{IN}/walk.npz")
    put(waving_grid(5), f"{IN}/caches/run.pc2")
    put(waving_grid(4), f"{IN}/a/cloth/f_%d.obj")
    store.pipe("/bucket/in/.hidden/x.npz", b"no")
    store.pipe("/bucket/in/old.reel", b"no")
    yield store
    store.store.clear()


def run(inputs=IN, out=OUT, **arguments):
    return run_batch(plan_batch(inputs, out, OPTIONS, **arguments), InlineExecutor())


def test_inputs_in_a_store_are_found_like_local_ones(store, tmp_path):
    store.get("/bucket/in", str(tmp_path / "in"), recursive=True)
    here, there = find_inputs(tmp_path / "in"), find_inputs(IN)
    assert {one.name: one.output for one in here} == {one.name: one.output for one in there}
    assert {one.name: one.size_bytes for one in here} == {one.name: one.size_bytes for one in there}


def test_streams_and_manifest_are_written_to_the_store(store, tmp_path):
    report = run()
    assert report.summary == "0 up to date, 3 encoded, 0 failed"
    store.get("/bucket/in", str(tmp_path / "in"), recursive=True)
    streams = {"walk.npz": "walk", "a/cloth": "a/cloth", "caches/run.pc2": "caches/run"}
    for source, name in streams.items():
        expected = meshreel.encode(meshreel.load(tmp_path / "in" / source), quality=60)
        assert store.cat(f"/bucket/out/{name}.reel") == expected
    assert json.loads(store.cat("/bucket/out/manifest.json"))["summary"]["done"] == 3


def test_foreign_object_is_replaced_only_with_force(store):
    store.pipe("/bucket/out/walk.reel", b"mine")
    assert set(run().failed) == {"walk.npz"}
    assert store.cat("/bucket/out/walk.reel") == b"mine"
    assert set(run(force=True).failed) == set()


def test_object_created_during_the_run_is_kept(store):
    plan = plan_batch(IN, OUT, OPTIONS)
    store.pipe("/bucket/out/walk.reel", b"mine")
    assert set(run_batch(plan, InlineExecutor()).failed) == {"walk.npz"}
    assert store.cat("/bucket/out/walk.reel") == b"mine"


def test_error_names_the_file_relative_to_the_input_folder(store):
    store.pipe("/bucket/in/a/cloth/f_2.obj", b"v 1 2 no\n")
    [record] = run().failed.values()
    assert record.error.startswith("a/cloth/f_2.obj: ")


def test_remote_inputs_can_be_written_to_a_local_folder(store, tmp_path):
    assert run(out=tmp_path / "out").summary == "0 up to date, 3 encoded, 0 failed"
    assert (tmp_path / "out" / "a" / "cloth.reel").is_file()
    assert run(out=tmp_path / "out").summary == "3 up to date, 0 encoded, 0 failed"


def test_web_server_is_rejected_as_input_folder(tmp_path):
    with pytest.raises(meshreel.StoreError, match="lists no folders"):
        find_inputs("https://example.invalid/in")


@pytest.mark.parametrize(("but_not", "is_left_out"), [(f"{IN}/a", True), (IN, False), (OUT, False)])
def test_output_folder_is_skipped_when_it_is_inside_the_input_folder(store, but_not, is_left_out):
    names = {source.name for source in find_inputs(IN, but_not=but_not)}
    assert ("a/cloth" in names) != is_left_out
    assert "walk.npz" in names


def test_manifest_of_a_slow_store_takes_a_tenth_of_the_time(store, monkeypatch):
    """Each write takes a second, and encoding no time: the first of three inputs is recorded."""
    clock, seen = itertools.count(), []
    monkeypatch.setattr("meshreel.app.batch.run.monotonic", lambda: float(next(clock)))
    write = Manifest.write

    def counted(manifest):
        seen.append(sorted(record.state for record in manifest.records.values()))
        write(manifest)

    monkeypatch.setattr(Manifest, "write", counted)
    assert run().summary == "0 up to date, 3 encoded, 0 failed"
    assert [states.count("done") for states in seen] == [0, 1, 3]
    assert json.loads(store.cat("/bucket/out/manifest.json"))["summary"]["done"] == 3


def test_a_failed_write_of_the_manifest_does_not_end_the_batch(store, monkeypatch):
    write, n_writes = Manifest.write, itertools.count()

    def fail_once(manifest):
        if next(n_writes) == 1:
            raise StoreError("the store is busy")
        write(manifest)

    monkeypatch.setattr(Manifest, "write", fail_once)
    assert run().summary == "0 up to date, 3 encoded, 0 failed"
    assert json.loads(store.cat("/bucket/out/manifest.json"))["summary"]["done"] == 3
    assert run().summary == "3 up to date, 0 encoded, 0 failed"
