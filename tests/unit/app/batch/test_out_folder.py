"""Output folder of a batch."""

from pathlib import Path

import pytest

from meshreel.app.batch.out_folder import OutFolder
from meshreel.errors import InvalidInputError


def test_write_creates_the_folders_of_a_file(tmp_path):
    folder = OutFolder(tmp_path / "out")
    folder.write("deep/er/x.reel", b"12", overwrite=False)
    assert (folder.has("deep/er"), folder.size_bytes("deep/er/x.reel")) == (True, 2)
    assert (folder.size_bytes("deep"), folder.has("y")) == (None, False)
    assert folder.read("deep/er/x.reel") == b"12"
    assert [path.name for path in (tmp_path / "out/deep/er").iterdir()] == ["x.reel"]


def test_file_is_replaced_only_with_overwrite(tmp_path):
    folder = OutFolder(tmp_path)
    folder.write("x.reel", b"old", overwrite=False)
    with pytest.raises(InvalidInputError, match="exists"):
        folder.write("x.reel", b"new", overwrite=False)
    assert folder.read("x.reel") == b"old"
    folder.write("x.reel", b"new", overwrite=True)
    assert folder.read("x.reel") == b"new"


def test_input_paths_are_relative_to_the_folder(tmp_path):
    folder = OutFolder(tmp_path / "out")
    assert folder.relative_path_to(tmp_path / "in" / "a") == "../in/a"
    assert folder.relative_path_to("s3://bucket/in") == "s3://bucket/in"
    assert Path(folder.called("x.reel")) == tmp_path / "out" / "x.reel"
