import pytest

from meshreel.atomic_write import replace_when_done
from meshreel.errors import InvalidInputError


def test_replace_writes_the_file_when_the_block_succeeds(tmp_path):
    with replace_when_done(tmp_path / "a.bin") as temporary:
        temporary.write_bytes(b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"new"


def test_replace_leaves_the_old_file_alone_when_the_block_fails(tmp_path):
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


def test_replace_refuses_when_the_file_exists(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(InvalidInputError, match="exists and is kept"), replace_when_done(path):
        pass


def test_replace_refuses_when_the_folder_is_missing(tmp_path):
    with (
        pytest.raises(InvalidInputError, match="does not exist"),
        replace_when_done(tmp_path / "no" / "a.bin"),
    ):
        pass
