import pytest

from meshreel.codec.bitstream.container import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError


@pytest.mark.parametrize("value", [0, 1, 127, 128, 300, 2**32, 2**63 - 1])
def test_varints_round_trip(value):
    data = b"x" + write_varint(value) + b"y"
    assert read_varint(data, 1) == (value, len(data) - 1)


def test_truncated_varint_is_refused():
    with pytest.raises(TruncatedStreamError):
        read_varint(write_varint(2**40)[:-1], 0)


def test_too_long_varint_is_refused():
    with pytest.raises(CorruptStreamError, match="longer than 9 bytes"):
        read_varint(b"\xff" * 20, 0)
