import struct
import zlib

import pytest

from meshreel.bitstream.header import Header, write_header
from meshreel.bitstream.layout import MAX_POSITIONS_PER_BYTE, OPTIONAL, Section, VertexType
from meshreel.bitstream.reader import read_stream
from meshreel.bitstream.sections import read_section, write_section
from meshreel.bitstream.writer import write_stream
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError

HEADER = Header(2, 3, 1, 0.0, VertexType.FLOAT64, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
SECTIONS = [
    (Section.CONNECTIVITY, b"abc"),
    (Section.BLOCK, b"1"),
    (Section.BASIS, b"first"),
    (Section.BLOCK, b"2"),
    (Section.BASIS, b""),
]


def test_sections_come_back_in_order_when_written():
    stream = read_stream(write_stream(HEADER, SECTIONS))
    assert stream.header == HEADER
    assert [(stored.id, stored.payload) for stored in stream.sections[:-1]] == SECTIONS
    assert stream.sections[-1].id is Section.END


def test_sizes_sum_to_the_whole_when_the_header_is_added():
    stream = read_stream(write_stream(HEADER, SECTIONS))
    parts = sum(stored.size_bytes for stored in stream.sections)
    assert parts + stream.header_size_bytes == stream.size_bytes


def test_blocks_group_their_sections_when_there_are_several():
    blocks = read_stream(write_stream(HEADER, SECTIONS)).blocks()
    assert [block[Section.BASIS] for block in blocks] == [b"first", b""]


@pytest.mark.parametrize(
    "sections",
    [
        [(Section.BASIS, b"")],
        [(Section.BLOCK, b""), (Section.BASIS, b""), (Section.BASIS, b"")],
    ],
)
def test_blocks_raise_when_a_section_is_out_of_place(sections):
    with pytest.raises(CorruptStreamError, match="out of place"):
        read_stream(write_stream(HEADER, sections)).blocks()


@pytest.mark.parametrize("sections", [[], [(Section.CONNECTIVITY, b"")] * 2])
def test_only_raises_when_there_is_not_exactly_one(sections):
    with pytest.raises(CorruptStreamError, match="exactly 1"):
        read_stream(write_stream(HEADER, sections)).only(Section.CONNECTIVITY)


def unknown_section(number):
    body = bytes([number, 2]) + b"??"
    return body + struct.pack("<I", zlib.crc32(body))


def test_unknown_section_is_skipped_when_it_is_optional():
    data = unknown_section(OPTIONAL | 77)
    assert read_section(data, 0) == (None, len(data))


def test_unknown_section_raises_when_it_is_required():
    with pytest.raises(UnsupportedVersionError, match="section 77 at byte 0"):
        read_section(unknown_section(77), 0)


def test_section_says_what_is_missing_when_it_is_cut():
    data = write_section(Section.BASIS, b"x" * 100)
    with pytest.raises(TruncatedStreamError, match="section BASIS at byte 0 needs 7 more bytes"):
        read_section(data[:-7], 0)


def test_section_raises_when_any_byte_is_changed():
    data = write_section(Section.BASIS, b"payload")
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 0x10
        with pytest.raises((CorruptStreamError, UnsupportedVersionError)):
            read_section(bytes(changed), 0)


def test_stream_raises_when_bytes_follow_its_end():
    with pytest.raises(CorruptStreamError, match="1 bytes follow"):
        read_stream(write_stream(HEADER, SECTIONS) + b"\0")


def test_stream_is_padded_when_its_counts_need_it():
    many = Header(10_000, 100, 1, 0.0, VertexType.FLOAT32, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
    data = write_stream(many, SECTIONS)
    assert len(data) >= 10_000 * 100 / MAX_POSITIONS_PER_BYTE
    assert read_stream(data).header == many


def test_stream_is_refused_when_it_announces_more_than_its_bytes_can_hold():
    huge = Header(2**31, 2**31, 1, 0.0, VertexType.FLOAT32, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
    with pytest.raises(CorruptStreamError, match="holds at most 256 positions or faces a byte"):
        read_stream(write_header(huge) + write_section(Section.END, b""))
