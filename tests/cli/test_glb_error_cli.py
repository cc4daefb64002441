"""Error bounds of glTF output, including the error of the stream."""

import re

import pytest

import meshreel
from samples.commands import assert_fails, run, run_json
from samples.meshes import waving_grid


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sequence, its stream with an error bound of 0.05 %, and one without a bound."""
    folder = tmp_path_factory.mktemp("budget")
    meshreel.save(waving_grid(), folder / "grid.npz")
    (folder / "kept.reel").write_bytes(meshreel.encode(waving_grid(), max_error=0.05))
    (folder / "plain.reel").write_bytes(meshreel.encode(waving_grid()))
    return folder


@pytest.mark.parametrize("command", ["decode", "convert"])
@pytest.mark.parametrize("bound", [0.08, 0.3, None])
def test_glb_is_within_the_stated_error_when_the_stream_has_a_bound(
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
def test_glb_is_rejected_when_its_bound_is_below_that_of_the_stream(folder, tmp_path, command):
    done = run(command, folder / "kept.reel", "-o", tmp_path / "a.glb", "--max-error", 0.04)
    assert_fails(done, "leaves nothing for morph targets", "itself has an error of up to 0.05")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["decode", "convert"])
def test_glb_note_names_the_reference_when_the_stream_has_no_bound(folder, tmp_path, command):
    figures = run_json(command, folder / "plain.reel", "-o", tmp_path / "a.glb")
    assert "errors are measured against the decoded animation" in " ".join(figures["notes"])
