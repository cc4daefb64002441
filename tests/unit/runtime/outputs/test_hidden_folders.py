import os
import re
import subprocess
import sys

import pytest

from meshreel.runtime.outputs.hidden_folders import hidden_folder, remove_abandoned

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="removal needs user ids")

KILLED = """
import os, signal, sys
from pathlib import Path
from meshreel.runtime.outputs.hidden_folders import hidden_folder
with hidden_folder(Path(sys.argv[1])) as folder:
    (folder / "half.npz").touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def abandoned(tmp_path):
    """A folder that a killed process left."""
    subprocess.run([sys.executable, "-c", KILLED, tmp_path], check=False, timeout=60)
    (left,) = tmp_path.iterdir()
    assert [path.name for path in left.iterdir()] == ["half.npz"]
    return left


def test_hidden_folder_is_removed_when_the_block_fails(tmp_path):
    def fail():
        with hidden_folder(tmp_path) as folder:
            (folder / "half").touch()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_folder_is_removed_when_its_process_was_killed(tmp_path, abandoned):
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_folder_is_kept_while_its_process_runs(tmp_path):
    with hidden_folder(tmp_path) as folder:
        remove_abandoned(tmp_path)
        assert list(tmp_path.iterdir()) == [folder]


def test_folder_of_another_machine_is_kept(tmp_path, abandoned):
    name = re.sub(r"-[0-9a-f]{12}-", "-0123456789ab-", abandoned.name)
    foreign = abandoned.rename(tmp_path / name)
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == [foreign]


def test_folder_of_another_user_is_kept(tmp_path, abandoned, monkeypatch):
    other = os.geteuid() + 1
    monkeypatch.setattr("os.geteuid", lambda: other)
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == [abandoned]


def test_link_with_the_name_of_a_folder_is_kept(tmp_path, abandoned):
    target = tmp_path / "mine"
    abandoned.rename(target)
    abandoned.symlink_to(target)
    remove_abandoned(tmp_path)
    assert abandoned.is_symlink()
    assert (target / "half.npz").exists()
