import struct
import zlib
from dataclasses import replace
from io import BytesIO

import pytest

from meshreel.bitstream.header import Header, write_header
from meshreel.bitstream.index import BlockPlace, write_index
from meshreel.bitstream.layout import (
    INDEX_POSITION,
    OPTIONAL,
    Section,
    VertexType,
)
from meshreel.bitstream.reader import open_stream, read_stream
from meshreel.bitstream.sections import read_section, write_section
from meshreel.bitstream.writer import StreamWriter, whole_stream
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from samples.streams import parts_of, raw_stream

HEADER = Header(2, 3, 1, 0.0, VertexType.FLOAT64, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
LEADING = [(Section.CONNECTIVITY, b"abc")]
BLOCKS = [
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b"first"), (Section.COEFFICIENTS, b"12")]),
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b""), (Section.COEFFICIENTS, b"3")]),
]
SECTIONS = [*LEADING, *BLOCKS[0][1], *BLOCKS[1][1]]
DATA = whole_stream(HEADER, LEADING, BLOCKS)
UNCOUNTED = replace(HEADER, n_frames=0)


def opened(data):
    return open_stream(BytesIO(data))


def test_sections_come_back_in_order_when_written():
    stream = read_stream(DATA)
    assert stream.header == HEADER
    assert parts_of(stream) == SECTIONS
    assert [stored.id for stored in stream.sections()][-2:] == [Section.INDEX, Section.END]


def test_sizes_sum_to_the_whole_when_the_header_is_added():
    stream = read_stream(DATA)
    parts = sum(stored.size_bytes for stored in stream.sections())
    assert parts + stream.header_size_bytes == stream.size_bytes


@pytest.mark.parametrize("read", [read_stream, opened])
@pytest.mark.parametrize("data", [DATA, raw_stream(HEADER, SECTIONS)], ids=["index", "none"])
def test_blocks_come_back_in_any_order_when_there_is_an_index_or_none(read, data):
    stream = read(data)
    assert stream.starts == [0, 1, 2]
    assert stream.is_whole
    for number in (1, 0, 1):
        assert list(stream.block(number).items()) == BLOCKS[number][1]


def test_stream_is_the_same_when_its_index_is_used():
    assert opened(DATA).places == read_stream(DATA).places
    assert opened(DATA).leading == read_stream(DATA).leading


@pytest.mark.parametrize("size", range(len(DATA)))
def test_blocks_before_the_cut_are_there_when_a_stream_is_cut(size):
    ends = [place.end for place in read_stream(DATA).places]
    n_whole = sum(end <= size for end in ends)
    if n_whole == 0:
        with pytest.raises(TruncatedStreamError):
            opened(DATA[:size])
        return
    stream = opened(DATA[:size])
    assert not stream.is_whole
    assert stream.n_frames == n_whole
    assert list(stream.block(n_whole - 1).items()) == BLOCKS[n_whole - 1][1]
    assert parts_of(stream) == [*LEADING, *(one for _, block in BLOCKS[:n_whole] for one in block)]


def test_a_block_is_left_out_when_its_last_section_is_missing():
    cut = raw_stream(UNCOUNTED, SECTIONS[:-1])[: -len(write_section(Section.END, b""))]
    assert opened(cut).n_frames == 1


def test_blocks_before_the_damage_are_there_when_the_index_and_a_later_block_are_damaged():
    second = read_stream(DATA).places[1]
    data = bytearray(DATA)
    data[second.position + 3] ^= 1
    data[-1] ^= 1
    stream = opened(bytes(data))
    assert (stream.n_frames, stream.is_whole) == (1, False)


def test_a_damaged_block_is_told_when_it_is_read_through_the_index():
    data = bytearray(DATA)
    data[read_stream(DATA).places[1].position + 3] ^= 1
    stream = opened(bytes(data))
    assert stream.block(0)
    with pytest.raises(CorruptStreamError):
        stream.block(1)


def test_a_block_is_refused_when_the_index_leads_to_nothing_that_is_known():
    before = write_header(HEADER) + write_section(*LEADING[0])
    unknown = bytes([OPTIONAL | 0x40, 2]) + b"ab"
    unknown += struct.pack("<I", zlib.crc32(unknown))
    index = write_index([BlockPlace(2, len(before), (len(unknown),))])
    end = INDEX_POSITION.pack(len(before) + len(unknown))
    behind = write_section(Section.INDEX, index) + write_section(Section.END, end)
    stream = opened(before + unknown + behind)
    assert [place.n_frames for place in stream.places] == [2]
    with pytest.raises(CorruptStreamError, match="block 0 has no section BLOCK"):
        stream.block(0)


def test_frames_are_counted_when_the_header_does_not_know_them():
    assert read_stream(whole_stream(UNCOUNTED, LEADING, BLOCKS)).n_frames == 2


def test_a_stream_is_refused_when_its_header_counts_other_frames():
    three = replace(HEADER, n_frames=3)
    with pytest.raises(CorruptStreamError, match="blocks hold 2 frames; the header announces 3"):
        read_stream(whole_stream(three, LEADING, BLOCKS))


@pytest.mark.parametrize("frames", [b"\1\2", b"\2\1"])
def test_an_index_is_refused_when_it_contradicts_the_blocks(frames):
    data = bytearray(DATA)
    start = read_stream(DATA).places[-1].end
    index, _ = read_section(BytesIO(DATA), start, len(DATA))
    payload = bytearray(index.payload)
    payload[2], payload[4] = frames
    data[start : start + index.size_bytes] = write_section(Section.INDEX, bytes(payload))
    with pytest.raises(CorruptStreamError, match="contradicts"):
        read_stream(bytes(data))


def test_a_stream_is_refused_when_its_end_leads_elsewhere():
    wrong = write_section(Section.END, b"\0" * 8)
    with pytest.raises(CorruptStreamError, match="point to the index"):
        read_stream(DATA[: -len(wrong)] + wrong)


def test_a_file_can_be_read_when_its_writer_was_not_finished():
    file = BytesIO()
    writer = StreamWriter(file, UNCOUNTED, LEADING)
    for n_written, block in enumerate(BLOCKS, start=1):
        writer.write_block(*block)
        assert opened(file.getvalue()).n_frames == n_written


def test_blocks_are_in_the_file_as_soon_as_they_are_written(tmp_path):
    with (tmp_path / "live.reel").open("wb", buffering=1 << 20) as file:
        writer = StreamWriter(file, UNCOUNTED, LEADING)
        for n_written, block in enumerate(BLOCKS, start=1):
            writer.write_block(*block)
            assert opened((tmp_path / "live.reel").read_bytes()).n_frames == n_written
        writer.finish()
        assert opened((tmp_path / "live.reel").read_bytes()).is_whole


@pytest.mark.parametrize(
    "sections",
    [
        [(Section.BASIS, b"")],
        [(Section.BLOCK, b"\1\1"), (Section.BASIS, b""), (Section.BASIS, b"")],
    ],
)
def test_blocks_raise_when_a_section_is_out_of_place(sections):
    with pytest.raises(CorruptStreamError, match="out of place"):
        read_stream(raw_stream(UNCOUNTED, sections)).block(0)


@pytest.mark.parametrize("sections", [[], [(Section.CONNECTIVITY, b"")] * 2])
def test_only_raises_when_there_is_not_exactly_one(sections):
    with pytest.raises(CorruptStreamError, match="exactly 1"):
        read_stream(raw_stream(UNCOUNTED, sections + BLOCKS[0][1])).only(Section.CONNECTIVITY)


@pytest.mark.parametrize("read", [read_stream, opened])
@pytest.mark.parametrize("header", [HEADER, UNCOUNTED])
def test_a_stream_is_refused_when_it_has_no_block(read, header):
    with pytest.raises(CorruptStreamError, match="no block of frames"):
        read(raw_stream(header, LEADING))


def unknown_section(number):
    body = bytes([number, 2]) + b"??"
    return body + struct.pack("<I", zlib.crc32(body))


def test_unknown_section_is_skipped_when_it_is_optional():
    data = unknown_section(OPTIONAL | 77)
    assert read_section(BytesIO(data), 0, len(data)) == (None, len(data))


def test_unknown_section_raises_when_it_is_required():
    with pytest.raises(UnsupportedVersionError, match="section 77 at byte 0"):
        read_section(BytesIO(unknown_section(77)), 0, 8)


def test_section_says_what_is_missing_when_it_is_cut():
    data = write_section(Section.BASIS, b"x" * 100)
    with pytest.raises(TruncatedStreamError, match="section BASIS at byte 0 needs 7 more bytes"):
        read_section(BytesIO(data[:-7]), 0, len(data) - 7)


def test_section_raises_when_any_byte_is_changed():
    data = write_section(Section.BASIS, b"payload")
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 0x10
        with pytest.raises((CorruptStreamError, UnsupportedVersionError)):
            read_section(BytesIO(changed), 0, len(changed))


def test_stream_raises_when_bytes_follow_its_end():
    with pytest.raises(CorruptStreamError, match="1 bytes follow"):
        read_stream(DATA + b"\0")


@pytest.mark.parametrize("counts", [{"n_verts": 2**31}, {"n_faces": 2**31}, {}])
def test_nothing_is_added_when_counts_are_large(counts):
    many = replace(UNCOUNTED, **counts)
    data = whole_stream(
        many, LEADING, [(10**6, [(Section.BLOCK, b"\xc0\x84\x3d\1"), (Section.COEFFICIENTS, b"")])]
    )
    assert len(data) < 300
    assert read_stream(data).header == many
