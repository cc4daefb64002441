import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.container import BufferWriter, write_container

LARGEST = (1 << 32) - 4  # sizes are multiples of 4


def file_size(path, buffer_bytes):
    """Return the size of a file with such a buffer, whose bytes are not written."""
    buffer = BufferWriter()
    buffer.size_bytes = buffer_bytes
    return write_container(path, {}, buffer, "less")


def test_files_are_limited_to_the_size_that_the_header_can_store(tmp_path):
    path = tmp_path / "a.glb"
    largest = LARGEST - (file_size(path, 1 << 31) - (1 << 31))
    assert file_size(path, largest) == LARGEST
    assert path.read_bytes()[8:12] == LARGEST.to_bytes(4, "little")
    with pytest.raises(InvalidInputError, match="at most 4294967295; less"):
        file_size(path, largest + 4)
