"""The manifest and other files of the output folder."""

import json

import pytest

from meshreel.app.batch.manifest import MANIFEST_NAME, Record, read_manifest, write_file
from meshreel.errors import InvalidInputError

RECORD = Record("done", "walk.reel", True, "abc", {"kg": 0.5}, seconds=1.5, notes=["cut"])


@pytest.fixture
def folders(tmp_path):
    made = tmp_path / "in", tmp_path / "out"
    for folder in made:
        folder.mkdir()
    return made


def written(folders):
    manifest = read_manifest(*folders)
    manifest.records["walk.npz"] = RECORD
    manifest.write()
    return manifest


def test_missing_manifest_is_empty(folders):
    assert read_manifest(*folders).records == {}
    assert list(folders[1].iterdir()) == []


def test_manifest_round_trips(folders):
    written(folders)
    assert read_manifest(*folders).records == {"walk.npz": RECORD}


def test_rewriting_the_manifest_leaves_no_other_file(folders):
    written(folders).write()
    assert [path.name for path in folders[1].iterdir()] == [MANIFEST_NAME]


def test_manifest_is_read_after_both_folders_were_moved(folders, tmp_path):
    written(folders)
    (tmp_path / "new").mkdir()
    moved = [folder.rename(tmp_path / "new" / folder.name) for folder in folders]
    assert read_manifest(*moved).records == {"walk.npz": RECORD}


def test_manifest_of_other_inputs_is_rejected(folders, tmp_path):
    written(folders)
    (tmp_path / "other").mkdir()
    with pytest.raises(InvalidInputError, match=r"inputs in \.\./in.*another folder"):
        read_manifest(tmp_path / "other", folders[1])
    assert set(read_manifest(tmp_path / "other", folders[1], force=True).records) == {"walk.npz"}


FACTS = {"made_by": "meshreel batch", "layout": 1, "input_dir": "../in", "inputs": {}}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "no json",
        "\x00",
        json.dumps({**FACTS, "layout": 2}),
        json.dumps({**FACTS, "made_by": "another"}),
        json.dumps({**FACTS, "inputs": {"walk.npz": {"state": "done"}}}),
        json.dumps({**FACTS, "inputs": []}),
    ],
)
@pytest.mark.parametrize("force", [False, True])
def test_other_files_are_rejected_as_manifest(folders, text, force):
    (folders[1] / MANIFEST_NAME).write_text(text)
    with pytest.raises(InvalidInputError, match="is not a manifest"):
        read_manifest(*folders, force=force)
    assert (folders[1] / MANIFEST_NAME).read_text() == text


def test_write_creates_the_folders_of_a_file(tmp_path):
    write_file(tmp_path / "out/deep/er/x.reel", b"12", overwrite=False)
    assert (tmp_path / "out/deep/er/x.reel").read_bytes() == b"12"
    assert [path.name for path in (tmp_path / "out/deep/er").iterdir()] == ["x.reel"]


def test_file_is_replaced_only_with_overwrite(tmp_path):
    path = tmp_path / "x.reel"
    write_file(path, b"old", overwrite=False)
    with pytest.raises(InvalidInputError, match="exists"):
        write_file(path, b"new", overwrite=False)
    assert path.read_bytes() == b"old"
    write_file(path, b"new", overwrite=True)
    assert path.read_bytes() == b"new"


def test_input_paths_are_relative_to_the_folder(tmp_path):
    out = tmp_path / "out"
    assert read_manifest(tmp_path / "in" / "a", out).input_dir == "../in/a"
    assert read_manifest("s3://bucket/in", out).input_dir == "s3://bucket/in"
    assert read_manifest(tmp_path / "in", out).path == out / MANIFEST_NAME
