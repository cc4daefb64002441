from types import SimpleNamespace

import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.container_writer import write_container

LARGEST = (1 << 32) - 4  # sizes are multiples of 4


def file_size(path, buffer_bytes):
    """Bytes that a file with so large a buffer has; of the buffer nothing is written."""
    return write_container(path, {}, SimpleNamespace(size_bytes=buffer_bytes, pieces=[]), "less")


def test_a_file_is_written_up_to_the_size_that_its_header_can_tell(tmp_path):
    path = tmp_path / "a.glb"
    largest = LARGEST - (file_size(path, 1 << 31) - (1 << 31))
    assert file_size(path, largest) == LARGEST
    assert path.read_bytes()[8:12] == LARGEST.to_bytes(4, "little")
    with pytest.raises(InvalidInputError, match="at most 4294967295; less"):
        file_size(path, largest + 4)
