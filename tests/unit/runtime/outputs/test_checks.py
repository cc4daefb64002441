import os
from pathlib import Path

import pytest

from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.checks import (
    check_extension,
    check_output_folder,
    check_output_path,
    check_output_paths,
)


@pytest.fixture
def original(tmp_path):
    path = tmp_path / "original.npz"
    path.write_bytes(b"original")
    return path


@pytest.mark.parametrize("kind", ["same", "dotted", "symbolic", "hard", "folder"])
@pytest.mark.parametrize("overwrite", [False, True])
def test_path_is_rejected_when_it_is_the_input(original, tmp_path, kind, overwrite):
    path = tmp_path / "other.npz"
    if kind == "same":
        path = original
    elif kind == "dotted":
        path = tmp_path / "." / ".." / tmp_path.name / original.name
    elif kind == "symbolic":
        path.symlink_to(original)
    elif kind == "hard":
        path.hardlink_to(original)
    else:
        (tmp_path / "link").symlink_to(tmp_path, target_is_directory=True)
        path = tmp_path / "link" / original.name
    with pytest.raises(InvalidInputError, match=r"is the input.* never replaced"):
        check_output_path(path, overwrite=overwrite, inputs=[tmp_path / "gone", original])


def test_path_is_allowed_when_another_file_is_the_input(original, tmp_path):
    other = tmp_path / "other.npz"
    other.write_bytes(b"original")
    check_output_path(other, overwrite=True, inputs=[original])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["original.npz", "other.npz"]


def test_paths_are_rejected_when_one_is_an_input(original, tmp_path):
    paths = [tmp_path / f"{number}.npz" for number in range(3)]
    paths[2].hardlink_to(original)
    with pytest.raises(InvalidInputError, match=r"2\.npz is the input .*original\.npz"):
        check_output_paths(paths, overwrite=True, inputs=[tmp_path / "first.npz", original])


def test_path_is_rejected_when_it_is_a_broken_link(tmp_path):
    (tmp_path / "a.npz").symlink_to(tmp_path / "gone")
    with pytest.raises(InvalidInputError, match="already exists"):
        check_output_path(tmp_path / "a.npz", overwrite=False)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the platform has no named pipes")
def test_path_is_rejected_when_it_is_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    with pytest.raises(InvalidInputError, match="a device or a pipe"):
        check_output_path(tmp_path / "a.npz", overwrite=True)


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="the platform has no /proc")
def test_path_is_rejected_when_its_folder_cannot_be_written():
    with pytest.raises(InvalidInputError, match="the folder /proc"):
        check_output_path(Path("/proc/x.reel"), overwrite=False)


def test_path_is_rejected_when_its_folder_is_a_file(original):
    with pytest.raises(InvalidInputError, match=r"original\.npz is a file; name a folder"):
        check_output_path(original / "a.npz", overwrite=False)


def test_check_leaves_no_folder(tmp_path):
    check_output_paths([tmp_path / "a" / "b" / "c.obj"], overwrite=False, makes_folder=True)
    assert list(tmp_path.iterdir()) == []


def test_folder_is_rejected_when_it_contains_an_input(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.npz").touch()
    (tmp_path / "link.npz").symlink_to(tmp_path / "out" / "a.npz")
    with pytest.raises(InvalidInputError, match=r"the input .*link\.npz is in .*out"):
        check_output_folder(tmp_path / "out", inputs=[tmp_path / "link.npz"])


def test_extension_is_returned_in_lower_case(tmp_path):
    assert check_extension(tmp_path / "a.HTML", (".html", ".htm")) == ".html"


@pytest.mark.parametrize(("name", "got"), [("a.txt", r"\.txt"), ("a", "no extension")])
def test_error_lists_the_allowed_extensions(tmp_path, name, got):
    with pytest.raises(InvalidInputError, match=rf"must end in \.png, \.gif; got {got}; see"):
        check_extension(tmp_path / name, (".png", ".gif"), "see elsewhere")
