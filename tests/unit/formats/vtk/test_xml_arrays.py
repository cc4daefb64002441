import pytest

from meshreel.errors import FormatError
from meshreel.formats.vtk.xml_arrays import unpack_lz4


@pytest.mark.parametrize(
    ("packed", "unpacked"),
    [
        (b"\x30abc", b"abc"),
        (b"\x10a\x01\x00\x10b", b"aaaaab"),  # a match that overlaps its output
        (b"\x20ab\x02\x00\x10c", b"abababc"),
        (b"\x40abcd\x03\x00\x10e", b"abcdbcdbe"),
        (b"\x10a\x01\x00\x00", b"aaaaa"),
        (b"\xf0\x01" + bytes(range(16)), bytes(range(16))),
        (b"\x1fa\x01\x00\xff\x02\x10b", b"a" * (1 + 15 + 255 + 2 + 4) + b"b"),
        (b"\xf0\xff\xf1" + bytes(511), bytes(511)),
    ],
)
def test_valid_block_is_decompressed(packed, unpacked):
    assert unpack_lz4(packed, len(unpacked)) == unpacked


@pytest.mark.parametrize(
    ("packed", "size_bytes"),
    [
        (b"", 0),
        (b"\x30ab", 3),
        (b"\x30abc", 2),
        (b"\x30abc", 4),
        (b"\x10a\x00\x00\x10b", 6),  # a match at distance 0
        (b"\x10a\x02\x00\x10b", 6),  # a match that begins before the block
        (b"\x10a\x02\x00\x10b", 5),
        (b"\x10a\x01\x00\x10b", 5),
        (b"\x10a\x01\x00", 5),  # ends with a match
        (b"\x1fa\x01\x00\xff", 277),
    ],
)
def test_damaged_block_is_rejected(packed, size_bytes):
    with pytest.raises(FormatError, match="that is not LZ4, or is damaged"):
        unpack_lz4(packed, size_bytes)
