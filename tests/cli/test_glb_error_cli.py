"""The error that glTF output states, including that of its stream."""

import re

import pytest

import meshreel
from samples.commands import assert_fails, run, run_json
from samples.meshes import waving_grid


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sequence, its stream that promises 0.05 %, and one that promises nothing."""
    folder = tmp_path_factory.mktemp("budget")
    meshreel.save(waving_grid(), folder / "grid.npz")
    (folder / "kept.reel").write_bytes(meshreel.encode(waving_grid(), max_error=0.05))
    (folder / "plain.reel").write_bytes(meshreel.encode(waving_grid()))
    return folder


@pytest.mark.parametrize("command", ["decode", "convert"])
@pytest.mark.parametrize("bound", [0.08, 0.3, None])
def test_glb_is_within_the_error_that_is_stated_when_a_stream_promises_one(
    folder, tmp_path, command, bound
):
    options = [] if bound is None else ["--max-error", bound]
    figures = run_json(command, folder / "kept.reel", "-o", tmp_path / "a.glb", *options)
    [note] = [note for note in figures["notes"] if note.startswith("against the original ")]
    total = float(re.search(r"at most ([\d.]+) %", note)[1])
    quality = run_json("compare", folder / "grid.npz", tmp_path / "a.glb")
    assert quality["max_error_percent"] <= total
    assert bound is None or total <= bound


@pytest.mark.parametrize("command", ["decode", "convert"])
def test_glb_is_refused_when_the_bound_is_below_the_promise(folder, tmp_path, command):
    done = run(command, folder / "kept.reel", "-o", tmp_path / "a.glb", "--max-error", 0.04)
    assert_fails(done, "leaves nothing for morph targets", "itself has an error of up to 0.05")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["decode", "convert"])
def test_glb_says_what_its_error_is_measured_against_when_a_stream_promises_none(
    folder, tmp_path, command
):
    figures = run_json(command, folder / "plain.reel", "-o", tmp_path / "a.glb")
    assert "errors are measured against the decoded animation" in " ".join(figures["notes"])
