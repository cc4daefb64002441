import errno
import os
import signal
import subprocess
import sys

import pytest

from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.atomic import replace_all_when_done, replace_when_done


def test_replace_writes_the_file_when_the_block_succeeds(tmp_path):
    with replace_when_done(tmp_path / "a.bin") as temporary:
        temporary.write_bytes(b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"new"


def test_replace_keeps_the_old_file_when_the_block_fails(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def write_half():
        with replace_when_done(path, overwrite=True) as temporary:
            temporary.write_bytes(b"half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_half()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_replace_raises_when_the_folder_is_missing(tmp_path):
    with (
        pytest.raises(InvalidInputError, match="does not exist"),
        replace_when_done(tmp_path / "no" / "a.bin"),
    ):
        pass


def test_replace_gives_the_file_the_default_mode(tmp_path):
    (tmp_path / "plain").touch()
    with replace_when_done(tmp_path / "a.bin") as temporary:
        temporary.touch()
    assert (tmp_path / "a.bin").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_replace_keeps_a_file_created_meanwhile_without_overwrite(tmp_path):
    path = tmp_path / "a.bin"

    def write_late():
        with replace_when_done(path) as temporary:
            temporary.write_bytes(b"late")
            path.write_bytes(b"first")

    with pytest.raises(InvalidInputError, match="already exists"):
        write_late()
    assert path.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("is_named", [False, True])
def test_error_names_the_output_when_writing_fails(tmp_path, is_named):
    paths = [tmp_path / name for name in ("a.obj", "b.obj", "c.obj")]

    def write_some():
        with replace_all_when_done(paths) as temporaries:
            for temporary in temporaries[:2]:
                temporary.touch()
            raise OSError(errno.ENOSPC, "full", *([temporaries[1]] if is_named else []))

    with pytest.raises(OSError, match="full") as caught:
        write_some()
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(paths[1]))


def test_error_keeps_the_name_of_another_file(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, replace_when_done(tmp_path / "a.bin"):
        (tmp_path / "input.obj").read_bytes()
    assert caught.value.filename == str(tmp_path / "input.obj")


def test_replace_creates_the_folder_when_the_block_succeeds(tmp_path):
    path = tmp_path / "a" / "b" / "c.obj"
    with replace_all_when_done([path], makes_folder=True) as temporaries:
        temporaries[0].write_bytes(b"new")
    assert path.read_bytes() == b"new"


def test_replace_leaves_no_folder_when_the_block_fails(tmp_path):
    def fail():
        with replace_all_when_done([tmp_path / "a" / "b" / "c.obj"], makes_folder=True):
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="removal needs user ids")
def test_replace_removes_files_left_by_a_killed_process(tmp_path):
    killed = (
        "import os, signal, sys; from pathlib import Path; "
        "from meshreel.runtime.outputs.atomic import replace_when_done\n"
        "with replace_when_done(Path(sys.argv[1])) as temporary:\n"
        "    temporary.touch(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    arguments = [sys.executable, "-c", killed, tmp_path / "a.bin"]
    assert subprocess.run(arguments, check=False, timeout=60).returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == 1
    with replace_when_done(tmp_path / "b.bin") as temporary:
        temporary.touch()
    assert [path.name for path in tmp_path.iterdir()] == ["b.bin"]
