"""Batches with remote inputs."""

import fsspec
import pytest

import meshreel
from meshreel.app.batch.discovery import find_inputs
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from samples.engines import InlineExecutor
from samples.meshes import waving_grid
from samples.stores import put

OPTIONS = EncodeOptions(config_of(quality=60))
IN = "memory://bucket/in"


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


def run(out):
    return run_batch(plan_batch(IN, out, OPTIONS), InlineExecutor())


def test_inputs_in_a_store_are_found_like_local_ones(store, tmp_path):
    store.get("/bucket/in", str(tmp_path / "in"), recursive=True)
    here, there = find_inputs(tmp_path / "in"), find_inputs(IN)
    assert {one.name: one.output for one in here} == {one.name: one.output for one in there}
    assert {one.name: one.size_bytes for one in here} == {one.name: one.size_bytes for one in there}


def test_streams_are_those_of_local_inputs(store, tmp_path):
    assert run(tmp_path / "out").summary == "0 up to date, 3 encoded, 0 failed"
    store.get("/bucket/in", str(tmp_path / "in"), recursive=True)
    streams = {"walk.npz": "walk", "a/cloth": "a/cloth", "caches/run.pc2": "caches/run"}
    for source, name in streams.items():
        expected = meshreel.encode(meshreel.load(tmp_path / "in" / source), quality=60)
        assert (tmp_path / "out" / f"{name}.reel").read_bytes() == expected
    assert run(tmp_path / "out").summary == "3 up to date, 0 encoded, 0 failed"


def test_error_names_the_file_relative_to_the_input_folder(store, tmp_path):
    store.pipe("/bucket/in/a/cloth/f_2.obj", b"v 1 2 no\n")
    [record] = run(tmp_path).failed.values()
    assert record.error.startswith("a/cloth/f_2.obj: ")


def test_web_server_is_rejected_as_input_folder(tmp_path):
    with pytest.raises(meshreel.StoreError, match="lists no folders"):
        find_inputs("https://example.invalid/in")
