"""Inputs of a batch and their names."""

import os

import pytest

from meshreel.app.batch.discovery import find_inputs
from meshreel.errors import InvalidInputError
from meshreel.operations.save import save
from samples.meshes import waving_grid


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "inputs"
    made.mkdir()
    return made


def put(folder, *paths):
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"x")


def outputs_of_folder(folder, **options):
    return {source.name: source.output for source in find_inputs(folder, **options)}


def test_npz_files_and_frame_folders_at_any_depth_are_inputs(folder):
    put(folder, "walk.npz", "a/b/run.NPZ", "a/cloth/f_1.obj", "a/cloth/f_2.obj", "c/x.stl")
    assert outputs_of_folder(folder) == {
        "walk.npz": "walk.reel",
        "a/b/run.NPZ": "a/b/run.reel",
        "a/cloth": "a/cloth.reel",
        "c": "c.reel",
    }


def test_input_folder_with_frames_is_an_input(folder):
    put(folder, "f_1.ply", "f_2.ply")
    assert outputs_of_folder(folder) == {".": "inputs.reel"}


def test_dots_in_names_are_kept_except_before_the_extension(folder):
    put(folder, "walk.v2.npz", "run.v3/f_1.off")
    assert outputs_of_folder(folder) == {"walk.v2.npz": "walk.v2.reel", "run.v3": "run.v3.reel"}


def test_other_files_are_ignored(folder):
    put(folder, "old.reel", "notes.txt", ".hidden.npz", ".cache/a.npz", "walk.npz", "empty/readme")
    assert outputs_of_folder(folder) == {"walk.npz": "walk.reel"}


def test_output_folder_within_the_input_folder_is_ignored(folder):
    put(folder, "walk.npz", "out/walk.npz")
    assert outputs_of_folder(folder, but_not=folder / "out") == {"walk.npz": "walk.reel"}
    assert set(outputs_of_folder(folder, but_not=folder)) == {"walk.npz", "out/walk.npz"}


def test_inputs_are_in_natural_order(folder):
    put(folder, "walk10.npz", "walk9.npz", "b/f.obj", "a/f.obj")
    assert list(outputs_of_folder(folder)) == ["walk9.npz", "walk10.npz", "a", "b"]


def test_links_are_followed_but_cycles_are_not(folder, tmp_path):
    put(tmp_path / "elsewhere", "run.npz")
    put(folder, "walk.npz")
    (folder / "linked").symlink_to(tmp_path / "elsewhere")
    (folder / "circle").symlink_to(folder)
    assert set(outputs_of_folder(folder)) == {"walk.npz", "linked/run.npz"}


def test_sources_in_a_relative_folder_are_absolute(folder, monkeypatch):
    put(folder, "walk.npz")
    monkeypatch.chdir(folder.parent)
    [one] = find_inputs(folder.relative_to(folder.parent))
    assert one.source == folder / "walk.npz"
    assert one.name == "walk.npz"


def test_error_without_inputs_lists_the_searched_formats(folder):
    put(folder, "notes.txt")
    with pytest.raises(InvalidInputError, match=r"no sequence under .*\.npz.*\.obj"):
        find_inputs(folder)


@pytest.mark.parametrize("name", ["missing", "file.npz"])
def test_file_as_input_folder_is_rejected(folder, name):
    put(folder, "file.npz")
    with pytest.raises(InvalidInputError, match="there is no folder"):
        find_inputs(folder / name)


@pytest.mark.parametrize("change", ["size", "time", "more", "fewer", "name"])
def test_fingerprint_changes_with_a_file(folder, change):
    put(folder, "cloth/f_1.obj", "cloth/f_2.obj")
    path = folder / "cloth" / "f_2.obj"
    os.utime(path, ns=(0, 10**18))
    [before] = find_inputs(folder)
    old = before.fingerprint()
    if change == "size":
        path.write_bytes(b"xy")
        os.utime(path, ns=(0, 10**18))
    elif change == "time":
        os.utime(path, ns=(0, 10**18 + 1000))
    elif change == "more":
        put(folder, "cloth/f_3.obj")
    elif change == "fewer":
        path.unlink()
    else:
        path.rename(path.with_name("f_4.obj"))
    [after] = find_inputs(folder)
    assert after.fingerprint() != old


def test_moving_the_folder_keeps_the_fingerprint(folder):
    put(folder, "cloth/f_1.obj", "cloth/readme.txt")
    [before] = find_inputs(folder)
    old = before.fingerprint()
    folder.rename(folder.with_name("moved"))
    put(folder.with_name("moved"), "cloth/readme.txt")
    [after] = find_inputs(folder.with_name("moved"))
    assert after.fingerprint() == old


def test_files_that_a_written_sequence_references_belong_to_the_input(tmp_path):
    written = save(waving_grid(3), tmp_path / "walk.pvd")
    [result] = find_inputs(tmp_path)
    assert result.name == "walk.pvd"
    assert set(result.files) == set(written)
    written[0].unlink()
    assert [source.name for source in find_inputs(tmp_path)] == ["walk_frames"]
