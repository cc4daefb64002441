import struct
import zlib
from dataclasses import replace
from io import BytesIO

import pytest

from meshreel.codec.bitstream.container import (
    BlockPlace,
    Header,
    StreamWriter,
    whole_stream,
    write_header,
    write_index,
    write_sections,
)
from meshreel.codec.bitstream.layout import INDEX_POSITION, OPTIONAL, Section, VertexType
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from samples.streams import Stream, parts_of, raw_stream

HEADER = Header(2, 3, 1, 0.0, VertexType.FLOAT64, 0, 0, 0, (0.0, 0.0, 0.0), 1.0)
LEADING = [(Section.CONNECTIVITY, b"abc")]
BLOCKS = [
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b"first"), (Section.COEFFICIENTS, b"12")]),
    (1, [(Section.BLOCK, b"\1\1"), (Section.BASIS, b""), (Section.COEFFICIENTS, b"3")]),
]
SECTIONS = [*LEADING, *BLOCKS[0][1], *BLOCKS[1][1]]
DATA = whole_stream(HEADER, LEADING, BLOCKS)
UNCOUNTED = replace(HEADER, n_frames=0)
(FIRST_START, FIRST_END), (SECOND_START, BLOCKS_END) = (one[0] for one in Stream(DATA).groups)
FIRST, SECOND = FIRST_END - FIRST_START, BLOCKS_END - SECOND_START


def section(number, payload):
    return write_sections([(number, payload)])[0]


def ended(data, index):
    """Append an index and its end marker."""
    position = INDEX_POSITION.pack(len(data))
    return data + section(Section.INDEX, index) + section(Section.END, position)


def damage_of(data):
    """Reason why a stream with readable first blocks is incomplete."""
    return str(Stream(data).file.info.damage)


def test_sections_come_back_in_order_when_written():
    stream = Stream(DATA)
    assert stream.header == HEADER
    assert parts_of(stream) == SECTIONS
    assert [number for number, _ in stream.sections][-2:] == [Section.INDEX, Section.END]


def test_sizes_sum_to_the_whole_when_the_header_is_added():
    stream = Stream(DATA)
    parts = sum(one.size_bytes for one in stream.file.sections())
    assert parts + stream.header_size_bytes == stream.file.info.size_bytes == len(DATA)


@pytest.mark.parametrize("data", [DATA, raw_stream(HEADER, SECTIONS)], ids=["index", "none"])
def test_blocks_come_back_in_any_order_when_there_is_an_index_or_none(data):
    stream = Stream(data)
    assert stream.file.starts == [0, 1, 2]
    assert stream.file.info.is_whole
    for number in (1, 0, 1):
        assert list(stream.block(number).items()) == BLOCKS[number][1]


@pytest.mark.parametrize("size", range(len(DATA)))
def test_blocks_before_the_cut_of_a_stream_are_readable(size):
    n_whole = (size >= FIRST_END) + (size >= BLOCKS_END)
    if n_whole == 0:
        with pytest.raises(TruncatedStreamError):
            Stream(DATA[:size])
        return
    stream = Stream(DATA[:size])
    assert not stream.file.info.is_whole
    assert stream.file.info.n_frames == n_whole
    assert list(stream.block(n_whole - 1).items()) == BLOCKS[n_whole - 1][1]
    assert parts_of(stream) == [*LEADING, *(one for _, block in BLOCKS[:n_whole] for one in block)]


def test_a_block_is_left_out_when_its_last_section_is_missing():
    cut = raw_stream(UNCOUNTED, SECTIONS[:-1])[: -len(section(Section.END, b""))]
    assert Stream(cut).file.info.n_frames == 1


def test_blocks_before_damage_are_readable_when_the_index_is_damaged_too():
    data = bytearray(DATA)
    data[SECOND_START + 3] ^= 1
    data[-1] ^= 1
    info = Stream(bytes(data)).file.info
    assert (info.n_frames, info.is_whole) == (1, False)


def test_a_damaged_block_is_refused_when_it_is_read_through_the_index():
    data = bytearray(DATA)
    data[SECOND_START + 3] ^= 1
    stream = Stream(bytes(data))
    assert stream.block(0)
    with pytest.raises(CorruptStreamError, match=f"checksum.*byte {SECOND_START}"):
        stream.block(1)


def test_a_block_is_refused_when_the_index_points_to_an_unknown_section():
    before = write_header(HEADER) + section(*LEADING[0])
    unknown = unknown_section(OPTIONAL | 0x40)
    index = write_index([BlockPlace(2, len(before), (len(unknown),))])
    stream = Stream(ended(before + unknown, index))
    assert stream.file.block(0).n_frames == 2
    with pytest.raises(CorruptStreamError, match="a block has no sections"):
        stream.file.group(0)


def test_frames_are_counted_when_the_header_has_no_number():
    assert Stream(whole_stream(UNCOUNTED, LEADING, BLOCKS)).file.info.n_frames == 2


def test_a_stream_is_not_whole_when_its_header_counts_other_frames():
    three = replace(HEADER, n_frames=3)
    assert "contradicts" in damage_of(whole_stream(three, LEADING, BLOCKS))


@pytest.mark.parametrize(
    "places",
    [
        [(1, FIRST - 1), (1, SECOND)],
        [(1, FIRST), (2, SECOND)],
        [(2, FIRST), (0, SECOND)],
        [(2, FIRST + SECOND), (0, 0)],
    ],
    ids=["shorter", "more frames", "no frames", "no bytes"],
)
def test_a_stream_is_not_whole_when_its_index_contradicts_the_blocks(places):
    index = write_index([BlockPlace(frames, FIRST_START, (size,)) for frames, size in places])
    assert "contradicts" in damage_of(ended(DATA[:BLOCKS_END], index))


def test_a_stream_is_not_whole_when_its_index_is_longer():
    index = dict(Stream(DATA).sections)[Section.INDEX]
    assert ended(DATA[:BLOCKS_END], index) == DATA
    assert "contradicts" in damage_of(ended(DATA[:BLOCKS_END], index + b"\1"))


def test_a_stream_is_not_whole_when_its_end_leads_elsewhere():
    wrong = section(Section.END, b"\0" * 8)
    assert "contradicts" in damage_of(DATA[: -len(wrong)] + wrong)


def test_a_file_can_be_read_when_its_writer_was_not_finished():
    file = BytesIO()
    writer = StreamWriter(file, UNCOUNTED, LEADING)
    for n_written, block in enumerate(BLOCKS, start=1):
        writer.write_block(*block)
        assert Stream(file.getvalue()).file.info.n_frames == n_written


def test_blocks_are_in_the_file_as_soon_as_they_are_written(tmp_path):
    with (tmp_path / "live.reel").open("wb", buffering=1 << 20) as file:
        writer = StreamWriter(file, UNCOUNTED, LEADING)
        for n_written, block in enumerate(BLOCKS, start=1):
            writer.write_block(*block)
            assert Stream((tmp_path / "live.reel").read_bytes()).file.info.n_frames == n_written
        writer.finish()
        assert Stream((tmp_path / "live.reel").read_bytes()).file.info.is_whole


def test_a_section_of_a_block_is_refused_when_it_is_outside_of_blocks():
    with pytest.raises(CorruptStreamError, match="outside of blocks"):
        Stream(raw_stream(UNCOUNTED, [(Section.BASIS, b"")]))


@pytest.mark.parametrize("header", [HEADER, UNCOUNTED])
def test_a_stream_is_refused_when_it_has_no_block(header):
    with pytest.raises(CorruptStreamError, match="no block of frames"):
        Stream(raw_stream(header, LEADING))


def unknown_section(number):
    body = bytes([number, 2]) + b"??"
    return body + struct.pack("<I", zlib.crc32(body))


def behind_header(unknown):
    header = write_header(HEADER)
    return header + unknown + raw_stream(HEADER, SECTIONS)[len(header) :]


def test_unknown_section_is_skipped_when_it_is_optional():
    stream = Stream(behind_header(unknown_section(OPTIONAL | 77)))
    assert next(stream.file.sections()).is_known is False
    assert parts_of(stream) == SECTIONS


def test_unknown_section_raises_when_it_is_required():
    start = len(write_header(HEADER))
    with pytest.raises(UnsupportedVersionError, match=f"newer version.*byte {start}"):
        Stream(behind_header(unknown_section(77)))


def test_a_stream_is_not_whole_when_bytes_follow_its_end():
    info = Stream(DATA + b"\0").file.info
    assert (info.n_frames, info.is_whole) == (2, False)


@pytest.mark.parametrize("counts", [{"n_verts": 2**26}, {"n_faces": 2**26}, {}])
def test_nothing_is_added_when_counts_are_large(counts):
    many = replace(UNCOUNTED, **counts)
    data = whole_stream(
        many, LEADING, [(10**6, [(Section.BLOCK, b"\xc0\x84\x3d\1"), (Section.COEFFICIENTS, b"")])]
    )
    assert len(data) < 300
    assert Stream(data).header == many
